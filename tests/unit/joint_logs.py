"""A machine, simulated by scipy, whose log is written in every way that people have: nothing of the project
takes part."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.signal import lfilter

DT = 0.002
INERTIA, DAMPING = 0.1, 0.4
HEADER = ("time [ms]", "torque [Nmm]", "angle [deg]")


def machine(n=1500, dt=DT):
    """Return time (n,) s, torque (n,) N·m, angle (n,) rad and speed (n,) rad/s of a rigid body with friction:
    the exact solution for a torque held from sample to sample."""
    t = dt * np.arange(n)
    torque = 0.3 * np.sin(2 * np.pi * 0.7 * t) + 0.2 * np.sin(2 * np.pi * 2.3 * t)
    a = np.exp(-DAMPING / INERTIA * dt)
    speed = lfilter([0.0, (1.0 - a) / DAMPING], [1.0, -a], torque)
    slip = (dt - (1.0 - a) * INERTIA / DAMPING) / DAMPING
    steps = (1.0 - a) * INERTIA / DAMPING * speed[:-1] + slip * torque[:-1]
    return t, torque, np.concatenate([[0.0], np.cumsum(steps)]), speed


def table(path: Path, header, columns, delimiter=",", decimal=".", digits=9, lines=()):
    """Write columns as text, ``lines`` above the header; returns the path."""
    rows = [
        delimiter.join(f"{v:.{digits}g}".replace(".", decimal) for v in row)
        for row in np.column_stack(columns)
    ]
    top = [*lines, *([delimiter.join(header)] if header else [])]
    path.write_text("\n".join([*top, *rows]) + "\n", encoding="utf-8")
    return path


def plain_table(path: Path, **how):
    """The machine's log whose header leaves nothing open."""
    t, torque, angle, _ = machine()
    return table(path, HEADER, (1e3 * t, 1e3 * torque, np.degrees(angle)), **how)


def mapping_file(path: Path, text: str):
    """Write a mapping file; returns the path."""
    path.write_text("haptic_teleop_import: 1\n" + text, encoding="utf-8")
    return path
