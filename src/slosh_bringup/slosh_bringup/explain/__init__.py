"""What the product's own words mean: effects and flags, for a terminal."""
