"""Mechanical models of liquid sloshing in a moving container."""
