"""Simulated plants: a structure plus a list of effects, compiled, and the hardware around them.

Pure modules import NumPy and friends only; the simulated robots as ROS 2 nodes lie in `nodes`.
"""
