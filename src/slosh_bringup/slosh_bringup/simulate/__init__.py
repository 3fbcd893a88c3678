"""Simulates a motion table: results, checks of the table, files and picture."""
