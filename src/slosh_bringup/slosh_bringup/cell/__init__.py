"""The simulated cell: motions, a truth liquid, a camera's images. It stands in for the robot."""
