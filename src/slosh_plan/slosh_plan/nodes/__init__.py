"""ROS nodes of the planner and the predictor."""
