"""Which bags of a cell's runs are kept, and which are deleted."""
