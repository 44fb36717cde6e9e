"""Records of a model under sines, simulated with it, whose arm nobody reads."""

import numpy as np

from haptic_teleop_sim.kernel import simulate
from haptic_teleop_sysid.estimation.records import Record

DT = 0.002


def recorded(model, seconds=20.0, rms=1.0, seed=1, dt=DT):
    """Eight sines of 0.3 to 6 Hz drive it; its angle is read in steps of 0.1 mrad."""
    time = dt * np.arange(int(seconds / dt))
    phases = np.random.default_rng(seed).uniform(0.0, 6.28, 8)
    drive = rms * sum(
        np.sin(2.0 * np.pi * f * time + p) for f, p in zip(np.linspace(0.3, 6.0, 8), phases, strict=True)
    )
    path = simulate(model, drive, dt)
    measured = np.column_stack([np.rint(path.motor_position / 1e-4) * 1e-4, np.full(len(time), np.nan)])
    return Record("made", dt, drive, measured, np.zeros(len(time)), (1e-4, 1e-4), at_rest=True)
