"""Motion tables, CSV, Parquet, ROS 1 bags and rosbag2's files: in and out."""
