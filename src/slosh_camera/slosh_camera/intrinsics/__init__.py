"""Estimates a camera's intrinsic parameters from images of a board; prints such boards."""
