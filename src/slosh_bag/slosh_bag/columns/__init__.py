"""Converts many messages at once to NumPy columns, and columns to serialised messages."""
