"""Explains slosh's terms on the terminal: effects, flags, columns and units."""
