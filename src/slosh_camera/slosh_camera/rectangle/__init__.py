"""Detects the free surface in a rectangular container, seen from the side."""
