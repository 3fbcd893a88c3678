"""Selects and schedules the messages to publish when a bag is played."""
