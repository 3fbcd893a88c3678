"""Reads messages of each kind as samples of one motion, live and in recordings."""
