"""Reads settings, topics and inputs of a recording; each message is decoded once, as columns."""
