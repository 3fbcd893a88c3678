"""Test tools: recordings, processes, ROS graphs and commands."""
