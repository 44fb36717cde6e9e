"""The parameters of a rigid body: J a + b v = u."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.motion import BandedMotion
from haptic_teleop_sysid.starting_model.input_fits import (
    EXPLAINS,
    UNSEEN,
    Solution,
    chosen_fit,
    ladder,
    motor_columns,
    refuse_unseen,
    rows,
)

#: Damping that a model has which no recording shows, as a share of the one that would take all of the input.
_LITTLE = 0.05


def rigid_body(motions: Sequence[BandedMotion], turns: bool, joint: str, recording: str) -> Solution:
    """Return the inertia and damping of a rigid body from its motions; ``turns``: whether it is a rotation;
    ``joint`` and ``recording`` are for sentences.

    Raises RecordingError where the inertia does not show.
    """
    told: list[str] = []
    fits = ladder(motions, motor_columns(motions, "rigid_body"), turns)
    chosen = chosen_fit(fits, 1)
    if not chosen.seen(1) and chosen.percent > EXPLAINS:
        # Slow motion against friction, which is none below zero, so that signs are right: the inertia is what
        # it may be at most, and the search goes from there.
        most = float(chosen.values[0] + 2.0 * chosen.errors[0])
        told.append(
            f"the inertia does not show in this motion: it is below about {most:.2g}, which the model has; "
            "a faster motion shows it"
        )
        chosen = replace(chosen, values=np.concatenate([[most], chosen.values[1:]]))
    else:
        refuse_unseen(chosen, joint, recording)
    if not chosen.errors[1] < UNSEEN * chosen.values[1]:
        little = _LITTLE * _taking_all(motions)
        seen = "motor_damping is hardly seen in this motion"
        if chosen.values[1] < little:
            # Searches go up to some times what a model has: from next to none they would not get anywhere.
            chosen = replace(chosen, values=np.concatenate([[chosen.values[0], little], chosen.values[2:]]))
            seen += f": the model has {100 * _LITTLE:.0f} % of what would take all of the input"
        told.append(seen)
    names = ("motor_inertia", "motor_damping")
    values, std = (
        {n: float(v) for n, v in zip(names, of, strict=False)} for of in (chosen.values, chosen.errors)
    )
    return Solution(fits[0], chosen, values, std, tuple(told))


def _taking_all(motions: Sequence[BandedMotion]) -> float:
    """Damping that would take all of the input, in its unit, s/rad."""
    drive, velocity = (rows(motions, pick) for pick in (lambda m: m.input, lambda m: m.velocity[:, 0]))
    return float(np.std(drive) / max(float(np.std(velocity)), 1e-300))
