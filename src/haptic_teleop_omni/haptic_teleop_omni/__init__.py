"""The Phantom Omni: transports, report codec, compensation, and its driver node.

There is no driver yet, so the package offers no executable; the simulated Omni is `omni_sim` of haptic_teleop_sim.
"""
