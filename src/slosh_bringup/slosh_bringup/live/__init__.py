"""A live run of a cell: its nodes, what they say, where it is kept, and its report."""
