"""The Quanser 2DSFJ: HIL board, amplifier, limit switches, and its driver node.

There is no driver yet, so the package offers no executable; the simulated 2DSFJ is `sfj_sim` of haptic_teleop_sim.
"""
