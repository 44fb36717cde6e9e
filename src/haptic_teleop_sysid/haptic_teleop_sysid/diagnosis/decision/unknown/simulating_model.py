"""The model that simulates, where something has no name: with the torques that are named beside it.

A friction that is told from reversals or from parity equations is in no fit yet.  It is put into the model
with the size that was told, because a fit beside something unknown takes that on, too; and the map of the
rest is drawn anew beside it, because a friction hides what follows the input or the angle.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import FAILURES
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.whole_fit import fit_whole

from ...evidence.measured_map import MeasuredMap
from ...evidence.second_method import Errors
from ...hypotheses.candidates import family
from ...hypotheses.follows import follows_from_motion
from ...inputs.scales import within_reach
from ..name_tests.place import effect_of
from ..search.freely_fitted import Resized, simulating_best
from ..verdict import Verdict

_STEPS = 15


@dataclass(frozen=True)
class WithTheNamed:
    """``fit`` of a model with the named torques, and ``mapped``: the map of the rest in it, or why there is
    none."""

    fit: Fit
    mapped: MeasuredMap


def not_in(verdict: Verdict, model: Model) -> list[Effect]:
    """The findings that are torques along the motion, of which the model has no form at their place."""
    there = {(name, e.location) for e in model.effects for name in family(e.effect)}
    found = [effect_of(f) for f in verdict.findings]
    return [e for e in found if follows_from_motion(e.entry) and (e.effect, e.location) not in there]


def with_the_named(
    verdict: Verdict,
    bare: Fit,
    present: Fit,
    given: Model,
    records: Sequence[Record],
    errors: Errors,
    resized: Resized,
    draw: Callable[[Fit], MeasuredMap],
) -> WithTheNamed | None:
    """The model ``bare`` with the torques that are named, and what is drawn beside them, where free runs of
    it err less than those of the ``present`` augmented model on both kinds of recordings; None otherwise.
    ``given``: the user's model, ``records``: of the estimation; ``resized``: beside the named torques the
    structure is fitted to predictions and to free runs, and what simulates best is taken."""
    named = not_in(verdict, bare.model)
    if not named:
        return None
    held = [f"{e.location}.{e.effect}.{p.name}" for e in named for p in e.entry.parameters]
    model = replace(bare.model.with_effects(*named), fixed=(*bare.model.fixed, *held))
    try:
        beside = fit_whole(model, bare.noise, records, iterations=_STEPS, limits=within_reach(given))
    except FAILURES:
        return None
    believed = replace(given, effects=model.effects, fixed=model.fixed)
    beside = simulating_best(beside, [beside.model, believed], resized, errors)
    mapped = draw(beside)
    fit = beside if mapped.fit is None else mapped.fit
    before, after = errors(present.model), errors(fit.model)
    better = all(np.isfinite(after)) and all(a < b for a, b in zip(after, before, strict=True))
    return WithTheNamed(fit, mapped) if better else None
