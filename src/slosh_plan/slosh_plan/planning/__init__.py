"""Finds the fastest motion along a path within limits of height, acceleration and jerk."""
