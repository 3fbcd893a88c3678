"""Calibration from a still image: pose and scale by a round container's edges, or by a board."""
