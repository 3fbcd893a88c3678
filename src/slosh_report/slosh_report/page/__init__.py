"""What every report's page is made of: frame of the page, style, charts over time, numbers."""
