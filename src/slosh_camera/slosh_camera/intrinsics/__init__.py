"""Estimates a camera's intrinsic parameters from images of a calibration board; prints boards."""
