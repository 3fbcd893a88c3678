"""ROS nodes of the governor and of the relay, and the simulated cell that is governed."""
