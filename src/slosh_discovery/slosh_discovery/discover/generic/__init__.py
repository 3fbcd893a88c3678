"""Generic terms in the equation of motion: a library, and what they do to the heights."""
