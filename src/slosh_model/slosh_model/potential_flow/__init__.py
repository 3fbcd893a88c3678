"""Computes sloshing modes by potential flow; uncached modes need scikit-fem."""
