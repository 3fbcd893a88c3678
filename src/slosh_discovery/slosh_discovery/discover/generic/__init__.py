"""Generic terms of the equation of motion: a library, and their effect on heights."""
