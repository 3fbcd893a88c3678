"""The first files of a cup of one's own: what is told of it, and the files' text."""
