"""Generic terms of the equation of motion, and their effect on the heights."""
