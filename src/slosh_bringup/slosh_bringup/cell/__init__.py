"""The simulated cell, which replaces the robot, the liquid and the camera."""
