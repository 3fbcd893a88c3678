"""Estimates sloshing height from acceleration and compares it with the measurement."""

SOURCES = ("slosh_estimator", "slosh_metrics", "slosh_model")
"""Packages whose code decides an estimate: a recording holds their digest."""
