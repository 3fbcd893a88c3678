"""The ROS node that serves a cell's state to controllers."""
