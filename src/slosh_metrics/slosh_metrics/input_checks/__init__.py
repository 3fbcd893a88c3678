"""Checks what an input claims to be, as samples come: gravity, units, frames, faults."""
