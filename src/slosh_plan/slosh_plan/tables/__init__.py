"""Reads tables of paths and trajectories."""
