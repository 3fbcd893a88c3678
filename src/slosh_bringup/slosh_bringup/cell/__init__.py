"""The simulated cell, which replaces the robot: motions, a reference liquid, camera images."""
