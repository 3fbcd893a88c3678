"""Metrics and checks of signals: MAE, ε, clock alignment, motion spans, input checks."""
