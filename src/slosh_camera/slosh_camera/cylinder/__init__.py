"""Detects the free surface in a transparent cylinder, seen through its wall."""
