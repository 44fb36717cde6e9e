"""Signals, filters, control laws and recordings of the teleoperation, and the nodes around them.

Pure modules import NumPy and friends only; everything that touches ROS 2 lies in `nodes`.
"""
