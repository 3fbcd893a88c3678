"""Detects the free surface in a cylinder, seen through its wall."""
