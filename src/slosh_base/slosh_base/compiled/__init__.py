"""Compiles functions once per machine, stores the machine code and checks it."""
