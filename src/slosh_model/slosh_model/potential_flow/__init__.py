"""Sloshing modes by potential flow; uncached ones need scikit-fem."""
