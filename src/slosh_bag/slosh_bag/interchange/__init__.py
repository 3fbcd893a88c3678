"""Imports and exports motion tables, CSV, Parquet, ROS 1 bags and rosbag2 files."""
