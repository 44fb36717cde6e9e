"""The driver of the Omni as a ROS 2 node."""
