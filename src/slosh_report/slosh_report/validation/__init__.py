"""Validation report of a container and a motion, with a digest, as an HTML or PDF file."""
