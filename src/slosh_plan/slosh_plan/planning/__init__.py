"""The fastest motion along a path that keeps the liquid's height, acceleration and jerk."""
