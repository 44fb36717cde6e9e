"""The simulated plants as ROS 2 nodes: interchangeable with the drivers of the same robots."""
