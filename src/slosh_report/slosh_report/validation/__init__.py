"""Validation report of a container and a motion: signed by digest, as HTML and PDF."""
