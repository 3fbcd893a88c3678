"""The black box: remembers what was heard last, and writes a bag round each event."""
