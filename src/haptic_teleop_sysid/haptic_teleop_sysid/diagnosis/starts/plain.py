"""Fits from where nothing is known, for what a linearisation does not see.

Where a large effect is missing, the fitted structure and noise levels have gone far to make up for it, and
from there the effect promises nothing: friction was taken for a disturbance that wanders, a constant torque
for another motor.  A fit of the effect beside what the lab believes, with noise levels that know nothing
either, finds it in a dozen steps.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.parallel import side_by_side
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.step_limits import Limits
from haptic_teleop_sysid.estimation.whole_fit import fit_whole, noise_starts

from ..hypotheses.candidates import candidates, contacts, plain_start
from ..inputs.scales import Scales

_STEPS = 12


def plain(
    lab: Model,
    records: Sequence[Record],
    scales: Scales,
    limits: Limits,
    progress: Callable[[str], None],
) -> list[Fit]:
    """The effects that may be so large that structure and noise make up for them (`EffectEntry.large`), each
    fitted beside the model that the lab believes in, with its noise levels from nothing."""
    noise = noise_starts(lab, records)[1]
    places = dict.fromkeys(
        (e.effect, e.location) for e in candidates(lab, records, scales, {}) if e.entry.large
    )
    starts: list[Effect] = []
    for name, location in places:
        middle = scales.contact_starts(1 if location.endswith("_arm") else 0)[1]
        for parameters in plain_start(EFFECTS[name], scales, location.rpartition("_")[2]):
            starts += contacts(Effect(name, location, parameters), scales, middle)

    def fitted(start: Effect) -> Fit:
        progress(f"fitting {start.effect} at {start.location} from nothing")
        return fit_whole(lab.with_effects(start), noise, records, iterations=_STEPS, limits=limits)

    return [f for f in side_by_side(fitted, starts) if np.isfinite(f.log_likelihood)]
