"""Rules by which old bags of a cell's runs are kept or deleted."""
