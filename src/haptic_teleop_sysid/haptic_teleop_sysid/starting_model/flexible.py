"""The parameters of a flexible joint: first the arm's, per stiffness, then the rest.

    q_m - q_a = (J_a / k) a_a + (b_a / k) v_a,   then   J_m a_m + b_m v_m + k (q_m - q_a) = u
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from haptic_teleop_control.errors import MismatchError
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.motion import BandedMotion
from haptic_teleop_sysid.starting_model.input_fits import (
    EXPLAINS,
    UNSEEN,
    Solution,
    chosen_fit,
    deflection,
    fitted,
    ladder,
    motor_columns,
    refuse_unseen,
    rows,
)


def flexible_joint(motions: Sequence[BandedMotion], turns: bool, joint: str, recording: str) -> Solution:
    """Return the five parameters of a flexible joint from its motions; ``turns``: whether it is a rotation;
    ``joint`` and ``recording`` are for sentences.

    Raises MismatchError where the arm does not move as an inertia on a spring does, RecordingError where the
    inertia does not show.
    """
    told: list[str] = []
    bend = deflection(motions)
    arm = np.column_stack(
        [rows(motions, lambda m: m.acceleration[:, 1]), rows(motions, lambda m: m.velocity[:, 1])]
    )
    ratio = fitted(arm, bend, 2, ())
    if not ratio.seen(1):
        raise MismatchError(
            f"{recording}: the arm of {joint} does not bend its joint as an inertia on a spring does "
            f"({ratio.percent:.3g} % explained): are its sign and unit right? Otherwise take "
            "--structure rigid_body."
        )
    fits = ladder(motions, motor_columns(motions, "flexible_joint"), turns)
    chosen = chosen_fit(fits, 3)
    per_stiffness, rub = (float(v) for v in ratio.values)
    doubt = float(ratio.errors[0]) / per_stiffness
    if chosen.seen(1) and chosen.errors[2] < UNSEEN * chosen.values[2]:
        inertia, damping, stiffness = (float(v) for v in chosen.values[:3])
        errors = [float(e) for e in chosen.errors[:3]]
        arm_inertia = stiffness * per_stiffness
        arm_error = arm_inertia * float(np.hypot(errors[2] / stiffness, doubt))
    else:
        fits = ladder(motions, motor_columns(motions, "rigid_body"), turns)
        chosen = chosen_fit(fits, 1)
        refuse_unseen(chosen, joint, recording)
        inertia = arm_inertia = 0.5 * float(chosen.values[0])
        stiffness, damping = arm_inertia / per_stiffness, float(chosen.values[1])
        arm_error = 0.5 * float(chosen.errors[0])
        errors = [arm_error, float(chosen.errors[1]), stiffness * doubt]
        told.append(
            "this motion does not tell the motor's inertia from the arm's: their sum was halved, and the "
            "stiffness follows from the natural frequency of the arm "
            f"({1.0 / (2.0 * np.pi * np.sqrt(per_stiffness)):.3g} Hz)"
        )
    if ratio.percent < EXPLAINS:
        told.append(
            f"one spring explains {ratio.percent:.3g} % of the deflection: there is more to this joint"
        )
    least = 1e-6 * damping + 1e-9 * inertia
    values = {
        "stiffness": stiffness,
        "motor_inertia": inertia,
        "motor_damping": max(damping, least),
        "arm_inertia": arm_inertia,
        "arm_damping": max(stiffness * rub, least),
    }
    std = {
        "stiffness": errors[2],
        "motor_inertia": errors[0],
        "motor_damping": errors[1],
        "arm_inertia": arm_error,
        "arm_damping": stiffness * float(ratio.errors[1]),
    }
    return Solution(fits[0], chosen, values, std, tuple(told))
