"""Common parts of all nodes: parameters, diagnostics, start and end of the process."""
