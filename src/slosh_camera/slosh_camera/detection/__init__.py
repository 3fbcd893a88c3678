"""Creates the detector for a calibration, and draws its results."""
