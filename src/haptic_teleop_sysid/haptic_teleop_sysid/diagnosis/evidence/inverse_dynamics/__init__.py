"""Inverse dynamics: which torques does the motion itself ask for?  Least squares, without any simulation."""
