"""Camera calibration: the file, and the pose from an image of a container or a board."""
