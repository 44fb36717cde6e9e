"""The driver of the 2DSFJ as a ROS 2 node."""
