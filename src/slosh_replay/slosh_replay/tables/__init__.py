"""Converts recordings to tables and tables to recordings."""
