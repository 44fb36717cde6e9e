"""Recordings of one joint, simulated by scipy's matrix exponential: nothing of the project takes part."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from plants import FLEXIBLE
from scipy.linalg import expm
from scipy.signal import cont2discrete, lfilter

from haptic_teleop_control.recording import JointStateSeries, Recording

START = 1_760_000_000_000_000_000
TRUTH = FLEXIBLE
DT = 0.002


def response(current, parameters=TRUTH, initial=(0.0, 0.0, 0.0, 0.0), dt=DT):
    """Return states (n, 4), motor and arm angle, motor and arm speed, of the linear joint to a held current
    (n,)."""
    p = parameters
    k, jm, bm, ja, ba = (
        p[n] for n in ("stiffness", "motor_inertia", "motor_damping", "arm_inertia", "arm_damping")
    )
    a = np.array([[0, 0, 1, 0], [0, 0, 0, 1], [-k / jm, k / jm, -bm / jm, 0], [k / ja, -k / ja, 0, -ba / ja]])
    b = np.array([0, 0, p["torque_constant"] / jm, 0])
    both = expm(dt * np.block([[a, b[:, None]], [np.zeros((1, 5))]]))
    states = np.empty((len(current), 4))
    x = np.array(initial, dtype=float)
    for i, u in enumerate(current):
        states[i] = x
        x = both[:4, :4] @ x + both[:4, 4] * u
    return states


def filtered_velocity(position, dt=DT):
    """Return the velocity that the 2DSFJ's filter (40 Hz, damping 0.9) makes of a position that began at
    rest."""
    w = 2.0 * np.pi * 40.0
    numerator, denominator, _ = cont2discrete(([w * w, 0.0], [1.0, 1.8 * w, w * w]), dt, "foh")
    return lfilter(numerator.ravel(), denominator, position - position[0])


def excitation(n, dt=DT, amplitude=0.3):
    """Return a current (n,), A: three sines, zero at the beginning."""
    t = dt * np.arange(n)
    phases = ((0.4, 0.0), (1.3, 0.0), (2.9, 0.0))
    return amplitude / 3 * sum(np.sin(2 * np.pi * f * t + phase) for f, phase in phases)


def joint_recording(current, states, dt=DT, stage="stage1", kind="open loop, sines", parameters=None):
    """Return a recording in the contract's layout. What is measured at a sample is the current that acted
    before it."""
    n = len(current)
    stamps = START + np.rint(1e9 * dt * np.arange(n)).astype(np.int64)
    names = ("stage1_motor", "stage1_arm", "stage2_motor", "stage2_arm")
    column = names.index(f"{stage}_motor")
    position, velocity, effort = np.zeros((n, 4)), np.zeros((n, 4)), np.zeros((n, 4))
    for offset in (0, 1):
        position[:, column + offset] = states[:, offset]
        velocity[:, column + offset] = filtered_velocity(states[:, offset], dt)
    constant = {"stage1": 8.925, "stage2": 1.392}[stage]
    effort[1:, column] = constant * current[:-1]
    effort[:, column + 1] = TRUTH["stiffness"] * (states[:, 0] - states[:, 1])
    commanded = np.zeros((n, 2))
    commanded[:, column // 2] = constant * current
    topics = {
        "/sfj/joint_states": JointStateSeries(stamps, stamps + 150_000, names, position, velocity, effort),
        "/sfj/effort_command": JointStateSeries(
            stamps, stamps + 400_000, ("stage1_motor", "stage2_motor"), effort=commanded
        ),
    }
    return Recording(Path("made"), topics, parameters or {}, experiment={"kind": kind})
