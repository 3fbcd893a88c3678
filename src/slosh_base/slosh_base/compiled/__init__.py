"""Compiles functions once per machine; stores and checks the compiled code."""
