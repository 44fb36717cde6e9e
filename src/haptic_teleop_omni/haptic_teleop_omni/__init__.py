"""The Phantom Omni: report layouts, transports, calibration, torque budget, and its driver node.

The driver has never run against a real device: see docs/drivers.md for what that means.
"""
