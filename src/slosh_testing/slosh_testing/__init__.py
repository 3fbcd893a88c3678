"""What tests share: recordings, processes, ROS graphs and commands; nothing else uses it."""
