"""Executes as much of commanded motions as the liquid allows, and slows planned ones."""
