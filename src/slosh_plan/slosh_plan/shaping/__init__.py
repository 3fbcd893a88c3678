"""Shapes motions so that they leave no residual wave of a given frequency."""
