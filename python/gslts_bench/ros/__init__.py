"""Benchmark of the ROS 2 node: a day of a simulated robot, over ROS."""
