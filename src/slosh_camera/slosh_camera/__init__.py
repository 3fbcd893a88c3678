"""Measures a liquid's free surface in camera images."""
