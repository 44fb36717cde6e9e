"""Sizes of what the inverse dynamics named, fitted once more to free runs.

A regression on torques weighs every stretch of the motion alike and knows nothing of where an error of an
inertia leads over seconds; an input that is a little late, or filtered, shifts its sizes together. The model
is handed on to be simulated. So its parameters are fitted to the simulated angles, too, and that is taken
where the other recordings, which neither was fitted to, are simulated clearly better by it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from haptic_teleop_control.errors import ModelError
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.likelihood import FAILURES
from haptic_teleop_sysid.simulation.parameter_fit import ParameterFit

from ..evidence.second_opinion import NO_WORSE, PERFECT, Errors, Heard
from ..policy import ERRS_LESS

#: The model fitted to free runs of the estimation recordings.
Simulated = Callable[[Model], ParameterFit]


def sized_freely(heard: Heard, simulated: Simulated, errors: Errors) -> Heard:
    """The group with the sizes that its free runs want, where those err on other recordings by ERRS_LESS as
    much and by no more on those that were fitted; else as it is. Standard errors hold what the two ways of
    fitting differ by."""
    group = heard.group
    try:
        found = simulated(group.model)
        reached = errors(found.model)
    except (*FAILURES, ModelError):
        return heard
    before = [max(e, PERFECT) for e in heard.errors]
    if found.fled or not reached[0] < NO_WORSE * before[0] or not reached[1] < ERRS_LESS * before[1]:
        return heard
    one, other = group.model.parameter_values(), found.model.parameter_values()
    std = {}
    for name, error in group.std.items():
        own = found.std.get(name, math.nan)
        # Half the squared difference is the variance of either, if they have the same.
        apart = (one[name] - other[name]) / math.sqrt(2.0) if name in one and name in other else 0.0
        std[name] = math.hypot(own if math.isfinite(own) else error, apart)
    return Heard(replace(group, model=found.model, std=std), heard.gain, reached)
