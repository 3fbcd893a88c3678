"""Motion maps: for each speed of a machine the stroke with the lowest waves."""
