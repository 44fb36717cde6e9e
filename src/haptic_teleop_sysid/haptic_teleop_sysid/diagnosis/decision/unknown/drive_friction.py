"""Friction of the drive beside something behind it, whatever that is.

What acts at the arm, in the joint or in the arm's encoder is in no term of that place's parity equation
(`inverse_dynamics.parity`), and friction of the drive is: that equation tells its size, whatever else acts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import FAILURES
from haptic_teleop_sysid.estimation.records import Record

from ...evidence.acting_place import ActingPlace
from ...evidence.inverse_dynamics.parity import torque_at_the_motor
from ...evidence.inverse_dynamics.parity_equations import ARM, ARM_ENCODER, JOINT, MOTOR, MOTOR_ENCODER
from ...policy import HOLDS_BETTER, LEAST_EXPLAINED, NOTICEABLE
from ..name_tests.objections import OTHER_SIZE
from ..name_tests.place import beside_findings
from ..verdict import Verdict
from .at_reversals import Turning, seen_apart


def with_drive_friction(
    verdict: Verdict,
    acting: ActingPlace,
    kinds: Sequence[Sequence[Record]],
    baseline: Fit,
    turning: Turning,
) -> Verdict:
    """The verdict with dry friction at the motor, where nothing is said of friction there, reversals do not
    exclude it, and the equation of a place behind the motor holds beside it and wants it: on the recordings
    of both ``kinds``, by sizes that do not differ by more than OTHER_SIZE, and so that it explains
    LEAST_EXPLAINED of what the equation leaves without it; and on those of one kind it is NOTICEABLE beside
    the input's torque."""
    acting = beside_findings(verdict, acting)
    dry = acting.dry_friction
    if turning.not_seen(dry.effect, dry.location) or acting.rubs(e for e in acting.beside if e != dry):
        return verdict
    if dry not in acting.beside:
        acting = replace(acting, beside=(*acting.beside, dry))
    place = _behind_the_motor(acting)
    if place is None:
        return verdict
    known = tuple(e for e in acting.beside if e != dry)
    model = acting.model.with_effects(*known)
    try:
        found = [torque_at_the_motor(model, acting.read(kind), acting.cutoff, dry, place) for kind in kinds]
    except FAILURES:
        return verdict
    told = [one for one in found if one is not None]
    if len(told) < len(kinds):
        return verdict
    sizes = [size for size, _, _ in told]
    explained = min(1.0 - (left / max(without, 1e-300)) ** 2 for _, left, without in told)
    taken = max(math.sqrt(max(without**2 - left**2, 0.0)) for _, left, without in told)
    steady = min(sizes) > 0.0 and max(sizes) - min(sizes) <= OTHER_SIZE * max(sizes)
    if not steady or explained < LEAST_EXPLAINED or taken < NOTICEABLE:
        return verdict
    effect = replace(dry, parameters={dry.entry.jumps: sum(sizes) / len(sizes)})
    where = acting.model.location(place)
    _, left, without = told[-1]
    words = (
        f"with it the equation of motion that does not contain {where}, whatever acts there, leaves "
        f"{100 * left:.2g} instead of {100 * without:.2g} % of the input's torque on the validation "
        f"recordings; it wants {sizes[0]:.3g} and {sizes[1]:.3g} N*m on the recordings of either kind"
    )
    named = seen_apart(effect, abs(sizes[0] - sizes[1]) / 2.0, words, baseline)
    return replace(verdict, findings=[*verdict.findings, named])


def _behind_the_motor(acting: ActingPlace) -> str | None:
    """The place behind the motor whose equation leaves least, and less by HOLDS_BETTER than those of the
    motor and its encoder. Which one it is need not be clear: a beam is no arm, and its gauge no encoder."""
    left = acting.bare
    behind = [place for place in (ARM, JOINT, ARM_ENCODER) if place in left]
    before = [left[place] for place in (MOTOR, MOTOR_ENCODER) if place in left]
    best = min(behind, key=lambda place: left[place], default=None)
    if best is None or not before or min(before) <= HOLDS_BETTER * left[best]:
        return None
    return best
