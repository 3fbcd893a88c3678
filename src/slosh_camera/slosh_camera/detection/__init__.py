"""Makes the detector of a calibration, and draws its results."""
