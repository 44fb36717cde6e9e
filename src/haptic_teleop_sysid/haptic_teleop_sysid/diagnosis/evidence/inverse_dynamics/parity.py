"""Where in a flexible joint does something act? Parity equations (Chow and Willsky, IEEE TAC 29, 1984).

    motor:  K u = J_m a_m + b_m v_m + k (q_m - q_a)      arm:  k (q_m - q_a) = J_a a_a + b_a v_a

One unknown signal enters them by its place alone. What eliminates it is one equation, which holds whatever
the signal is: the arm's for a torque at the motor, the motor's for one at the arm, the sum of both for one in
the joint, and for the error of an encoder what is left without that encoder. Only the equation of the right
place holds. No name, and no model of noise, is asked for; with unknown signals at two places none holds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.records import Record

from .band import long_enough
from .parity_equations import ARM, ARM_ENCODER, ENCODERS, JOINT, MOTOR, MOTOR_ENCODER, Signals
from .parity_fit import best_arm_response, counted, left_by, rms, solved
from .parity_signals import acts_at, both_read, can_allow_for, signals, sticks

#: Share of the input's torque that is none.
_NOTHING = 1e-6


def parity_residuals(
    model: Model,
    records: Sequence[Record],
    cutoff: float,
    known: Sequence[Effect] = (),
    encoders: Sequence[str] = ENCODERS,
    sliding: Sequence[Effect] = (),
) -> dict[str, float]:
    """What each place's parity equation leaves, rms, as a share of the input's torque: by place (motor, arm,
    joint, and those of ``encoders``), of a flexible joint. What the motor's leaves
    is in units of the model's stiffness. The equation without the motor's encoder is one of signals as the
    arm follows them, which are smoother: it has the share of the best of the others, times what it leaves
    relative to that one as smooth. Beside a dry friction only samples count at which it slides, and an
    encoder may be left out. Empty where both encoders were read too seldom to say, or nothing drives.

    ``cutoff``: Hz, of the motion's band; ``known``: effects whose torques are allowed for, whatever their
    size, as far as `can_allow_for` says so; ``sliding``: frictions that are not, beside which only the same
    samples count: what is left beside them, too, is compared with that."""
    known = [effect for effect in known if can_allow_for(effect.entry)]
    stretches = [stretch for record in records for stretch in both_read(record, cutoff)]
    every = (signals(model, r, cutoff, known, sliding) for r in long_enough(stretches, cutoff))
    parts = [p for p in every if len(p.kept)]
    if not any(np.any(p.torque[p.kept]) for p in parts):
        return {}
    equations = {
        MOTOR: [p.without_motor(model.parameters["stiffness"]) for p in parts],
        ARM: [p.without_arm() for p in parts],
        JOINT: [p.without_joint() for p in parts],
    }
    if ARM_ENCODER in encoders:
        arms = best_arm_response(model, parts, Signals.without_arm_encoder, descends=True)
        equations[ARM_ENCODER] = [p.without_arm_encoder(arm) for p, arm in zip(parts, arms, strict=True)]
    driven = rms([p.torque[p.kept] for p in parts])
    found = {place: left_by(counted(parts, rows)) / driven for place, rows in equations.items()}
    if MOTOR_ENCODER in encoders:
        arms = best_arm_response(model, parts, Signals.without_motor_encoder, descends=False)
        smooth = {
            place: left_by(counted(parts, [one.seen(arm) for one, arm in zip(rows, arms, strict=True)]))
            for place, rows in equations.items()
        }
        own = left_by([p.without_motor_encoder(arm, p.kept) for p, arm in zip(parts, arms, strict=True)])
        best = {min(measure, key=lambda place: measure[place]) for measure in (found, smooth)}
        least = _NOTHING * driven
        found[MOTOR_ENCODER] = max(own / max(smooth[place], least) * found[place] for place in best)
    for encoder in _blurred(model, [*known, *sliding]):
        if encoder in found and found[encoder] > min(found.values()):
            del found[encoder]
    return found if all(map(math.isfinite, found.values())) else {}


def torque_at_the_motor(
    model: Model, records: Sequence[Record], cutoff: float, effect: Effect, place: str
) -> tuple[float, float, float] | None:
    """The size of an effect of one size at the motor that the equation of another place wants, whatever acts
    at that place; and what this equation leaves with and without it, rms, as a share of the input's torque.
    None where the encoders were read too seldom to say. ``place``: arm, joint or arm_encoder; the other
    arguments: see `parity_residuals`."""
    stretches = [stretch for record in records for stretch in both_read(record, cutoff)]
    read = (signals(model, r, cutoff, [effect, *model.effects]) for r in long_enough(stretches, cutoff))
    parts = [p for p in read if len(p.kept)]
    if not parts:
        return None
    if place == ARM_ENCODER:
        arms = best_arm_response(model, parts, Signals.without_arm_encoder, descends=True)
        equations = [p.without_arm_encoder(arm, p.kept) for p, arm in zip(parts, arms, strict=True)]
    else:
        every = [p.without_arm() if place == ARM else p.without_joint() for p in parts]
        equations = counted(parts, every)
    if not equations or parts[0].known[MOTOR].shape[1] == 0:
        return None
    # A constant comes first, then what is known to act at the motor, with its sign on this side.
    bare = [replace(one, free=np.delete(one.free, 1, axis=1)) for one in equations]
    wider = [
        replace(
            one,
            structure=np.column_stack([one.structure, -full.free[:, 1]]),
            bounds=(*one.bounds, (-np.inf, np.inf)),
        )
        for one, full in zip(bare, equations, strict=True)
    ]
    (left, factors), (without, _) = solved(wider), solved(bare)
    driven = rms([p.torque[p.kept] for p in parts])
    if not math.isfinite(left) or not math.isfinite(without):
        return None
    return float(factors[wider[0].structure.shape[1] - 1]), left / driven, without / driven


def _blurred(model: Model, known: Sequence[Effect]) -> tuple[str, ...]:
    """The encoders whose equation contains a dry friction as the arm follows it, and with that what it is off
    by while it sticks, at all samples: they say nothing unless they leave the least."""
    rubs = {acts_at(model, effect.location) for effect in known if sticks(effect)}
    return ENCODERS if ARM in rubs else (MOTOR_ENCODER,) if MOTOR in rubs else ()
