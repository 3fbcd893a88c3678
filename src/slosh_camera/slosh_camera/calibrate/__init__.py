"""The calibration of a camera: its file, and its pose by a still image of a cup or of a board."""
