"""Common parts of all report pages: head, style, images, charts over time, numbers."""
