"""Camera calibration: its file, and the pose from a still image of a cup or a board."""
