"""Accuracy metrics, clock alignment, and the report of a run."""
