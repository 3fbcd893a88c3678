"""Event recorder: keeps recent messages in memory and writes a bag around each event."""
