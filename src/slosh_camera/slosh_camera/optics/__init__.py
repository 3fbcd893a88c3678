"""What a calibrated camera sees of a container: lens, pose, walls that bend light."""
