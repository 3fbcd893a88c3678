"""Selects and schedules the messages that are published when a bag is played."""
