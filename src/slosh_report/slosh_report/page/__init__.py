"""Common parts of all report pages: header, style, images, time charts and numbers."""
