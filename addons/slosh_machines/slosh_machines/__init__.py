"""Motion maps: the stroke with the lowest waves for each speed of a machine."""
