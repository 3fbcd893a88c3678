"""Offline detection: images in, a table and pictures out."""
