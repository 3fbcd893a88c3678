"""Checks of an input stream: gravity, units, frames and sensor faults."""
