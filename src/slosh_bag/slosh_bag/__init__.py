"""Records, reads, imports and replays MCAP bags of a slosh cell."""
