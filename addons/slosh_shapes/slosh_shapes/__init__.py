"""Computes sloshing modes of containers by potential flow; uncached modes need scikit-fem."""
