"""Whether a sensor is mounted, scaled and signed as it is said to be, by another source."""
