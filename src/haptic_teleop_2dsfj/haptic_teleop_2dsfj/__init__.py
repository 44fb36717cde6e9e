"""The Quanser 2DSFJ: HIL board, amplifier, limit switches, and its driver node.

The driver has never run against the robot: see docs/drivers.md for what that means.
"""
