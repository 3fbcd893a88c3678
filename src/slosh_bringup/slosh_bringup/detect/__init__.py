"""Offline detection: from images to a table and pictures."""
