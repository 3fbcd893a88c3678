"""Explains the product's terms on the terminal: effects, flags and others."""
