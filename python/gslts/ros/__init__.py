"""ROS 2 node: keeps the map of a robot up to date by what the robot sees."""
