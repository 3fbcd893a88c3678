"""Streaming checks of an input's gravity, units, frames and faults."""
