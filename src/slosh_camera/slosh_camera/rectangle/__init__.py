"""Detects the free surface in a container seen from the side."""
