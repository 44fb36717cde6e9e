"""The ROS 2 nodes of this package: the only place that imports `rclpy` and messages."""
