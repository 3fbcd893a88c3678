"""Judges recordings of one container and motion for a validation report; checks such a report."""
