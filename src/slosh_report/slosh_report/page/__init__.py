"""What every report's page is made of: head and style, images, charts over time, numbers."""
