"""Shapes motions so that they leave no residual wave of one frequency."""
