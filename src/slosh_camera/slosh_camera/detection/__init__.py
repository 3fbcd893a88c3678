"""Creates the detector for a calibration, and draws measurement results."""
