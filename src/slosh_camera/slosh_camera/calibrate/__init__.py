"""Camera calibration: the file, and the pose from a still image of a container or board."""
