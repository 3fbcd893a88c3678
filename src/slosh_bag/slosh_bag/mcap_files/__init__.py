"""Parts of MCAP files: chunks, summaries and metadata, with their readers and writers."""
