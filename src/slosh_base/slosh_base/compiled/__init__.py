"""Compiles functions once on a machine, and keeps and checks the compiled code."""
