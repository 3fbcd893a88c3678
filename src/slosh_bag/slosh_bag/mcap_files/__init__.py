"""The parts of MCAP files: chunks, summaries, metadata; reading, walking and writing them."""
