"""Judges recordings of one container and motion for a validation report, and checks reports."""
