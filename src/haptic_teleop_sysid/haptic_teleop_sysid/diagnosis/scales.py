"""The scales of a recording, by which the size of an effect is judged large or small."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.records import Record
from scipy.signal import savgol_filter


def recording_scales(model: Model, records: Sequence[Record]) -> dict[str, float]:
    """Typical sizes in SI units, keyed as ``EffectParameter.scale``: rms torque, largest angle and deflection from the
    start, rms velocity, the structure's stiffness, damping and inertia, and what follows from them."""
    torque, angle, deflection, velocity, duration = 0.0, 0.0, 0.0, 0.0, 0.0
    for r in records:
        torque = max(torque, model.parameters["torque_constant"] * float(np.sqrt(np.mean(r.input**2))))
        q = np.nan_to_num(r.measured[:, 0])
        length = max(5, 2 * int(0.015 / r.dt) + 1)
        v = savgol_filter(q, min(length, (len(q) - 1) // 2 * 2 + 1), 2, deriv=1, delta=r.dt)
        velocity = max(velocity, float(np.sqrt(np.mean(v**2))))
        angle = max(angle, float(np.nanmax(np.abs(r.measured))))
        if not model.rigid:
            deflection = max(deflection, float(np.nanmax(np.abs(r.measured[:, 0] - r.measured[:, 1]))))
        duration = max(duration, len(r) * r.dt)
    p = model.parameters
    torque, angle, velocity = max(torque, 1e-12), max(angle, 1e-9), max(velocity, 1e-9)
    deflection = max(deflection, 1e-9)
    stiffness = float(p.get("stiffness", torque / angle))
    return {
        "torque": torque, "angle": angle, "deflection": deflection, "velocity": velocity, "stiffness": stiffness,
        "damping": max(float(p["motor_damping"]), 0.1 * torque / velocity),
        "inertia": float(p.get("arm_inertia", p["motor_inertia"])), "drag": 0.3 * torque / velocity**2,
        "cubic": stiffness / deflection**2, "duration": duration, "one": 1.0,
    }
