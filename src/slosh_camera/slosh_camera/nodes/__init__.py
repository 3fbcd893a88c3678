"""The ROS nodes of this package."""
