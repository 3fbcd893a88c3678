"""Sloshing modes by potential flow; needs scikit-fem where they are not known yet."""
