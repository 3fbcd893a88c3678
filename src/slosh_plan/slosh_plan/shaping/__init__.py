"""Motions without residual waves of one frequency, for machines without an optimiser."""
