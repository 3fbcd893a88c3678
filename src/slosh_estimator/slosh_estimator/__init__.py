"""Estimates sloshing height from acceleration and compares it with the measurement."""
