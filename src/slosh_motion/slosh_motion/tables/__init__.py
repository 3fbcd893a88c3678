"""Reads tables of numbers in common formats, for all commands."""
