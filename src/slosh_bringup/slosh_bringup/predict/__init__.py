"""Predicted motions side by side: a picture and a page."""
