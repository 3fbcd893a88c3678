"""What every node shares: parameters, diagnostics, start and end of the process."""
