"""Many messages at once as NumPy columns, and back to their bytes."""
