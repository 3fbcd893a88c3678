"""Metrics and checks of signals: accuracy, clock alignment, motion spans, input checks."""
