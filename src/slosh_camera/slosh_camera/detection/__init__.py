"""The detector that fits a calibration, ready to measure, and pictures of what it found."""
