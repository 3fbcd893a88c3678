"""Replay of the nodes' own code by the journals of what they took."""
