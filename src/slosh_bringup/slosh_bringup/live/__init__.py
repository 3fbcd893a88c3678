"""A live run of a cell: its nodes, their diagnostics, its folder and its report."""
