"""Estimates sloshing height from the container's acceleration and compares it with the camera."""

SOURCES = ("slosh_estimator", "slosh_motion", "slosh_model")
"""Packages whose code decides an estimate: a recording holds their digest."""
