"""Reads the contents of a recording: node settings, topics, inputs and motion.

Replay, discovery, export and report read it here; each message is decoded once, as columns.
"""
