"""Figures and checks of signals: σ and ε, clock alignment, motion spans, checks of an input."""
