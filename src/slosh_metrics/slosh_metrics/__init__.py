"""Figures and checks of signals: MAE and ε, clock alignment, motion spans, checks of an input."""
