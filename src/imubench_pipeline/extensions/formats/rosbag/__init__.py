"""ROS bags, 1 and 2."""
