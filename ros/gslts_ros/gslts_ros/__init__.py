"""The node of gslts as a ROS 2 package."""
