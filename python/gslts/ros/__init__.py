"""ROS 2 node: messages in and out. Its modules need the Python packages of a ROS installation."""
