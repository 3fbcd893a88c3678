"""Converts many messages at once to NumPy columns and back to bytes."""
