"""ROS 2 bags as data sets: topics, images, tf2 poses."""
