"""Compares signals: errors, alignment of clocks, times of motions."""
