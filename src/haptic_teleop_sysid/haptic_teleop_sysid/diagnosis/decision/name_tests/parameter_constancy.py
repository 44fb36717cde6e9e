"""Parameter constancy: do both kinds of recordings want the same machine?

Where nothing is missing, the structure fitted to the estimation recordings predicts the others as well as the
same structure fitted to them.  Two robots of one kind, a payload that was changed in between, or a drive that
was warm on one day only differ in parameters: no physics is missing in either recording, and no number is
true of both.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.whole_fit import fit_whole

from ...evidence.certainty import standard_errors
from ...evidence.held_out import held_out_fit
from ...evidence.whiteness import colour
from ...policy import ANOTHER_MACHINE, COLOURED, ONLY_HERE
from ..coloured import more_coloured
from ..reasons import Doubt

_STEPS = 15
#: Standard errors of both fits together by which a parameter must differ.
_APART = 5.0


def inconstant(baseline: Fit, validation: Sequence[Record]) -> Doubt | None:
    """The doubt where the validation recordings are predicted far better by other parameters, which differ
    from those of ``baseline`` beyond their errors; None where they agree."""
    there = held_out_fit(baseline, validation, [baseline.noise])
    own = fit_whole(baseline.model, there.noise, validation, free=baseline.free, iterations=_STEPS)
    if not own.log_likelihood > there.log_likelihood + ONLY_HERE:
        return None
    numbers = _differing(baseline, own)
    if not numbers:
        return None
    return _disagreement(f"{_in_words(numbers)}, estimation and validation")


def apart(baseline: Fit, estimation: Sequence[Record]) -> Doubt | None:
    """The doubt where the estimation recordings are of machines with other parameters: each is predicted far
    better by its own, among which an inertia differs beyond its error, and nothing is left of it then. None
    where they agree, or something else is missing, which may look like another damping in each motion."""
    by_name = dict[str, list[Record]]()
    for record in estimation:
        by_name.setdefault(record.name, []).append(record)
    if len(by_name) < 2:
        return None
    gained, owns = 0.0, dict[str, Fit]()
    for name, records in by_name.items():
        there = held_out_fit(baseline, records, [baseline.noise])
        own = fit_whole(baseline.model, there.noise, records, free=baseline.free, iterations=_STEPS)
        left = colour(own, records)
        if left > COLOURED and more_coloured([left], [(own, records)]):
            return None
        gained += own.log_likelihood - there.log_likelihood
        owns[name] = own
    if not gained > ONLY_HERE:
        return None
    for (name, own), (other, its) in itertools.combinations(owns.items(), 2):
        numbers = _differing(own, its)
        if any(parameter.endswith("inertia") for parameter in numbers):
            return _disagreement(f"{_in_words(numbers)}, {name} and {other}")
    return None


def _differing(one: Fit, other: Fit) -> dict[str, tuple[float, float]]:
    """Both values of the parameters that differ by ANOTHER_MACHINE and beyond their errors."""
    before, after = one.model.parameter_values(), other.model.parameter_values()
    errors = standard_errors(one), standard_errors(other)
    return {
        name: (before[name], after[name])
        for name in one.free
        if abs(after[name] - before[name]) > ANOTHER_MACHINE * min(abs(before[name]), abs(after[name]))
        and abs(after[name] - before[name]) > _APART * float(np.hypot(errors[0][name], errors[1][name]))
    }


def _in_words(numbers: dict[str, tuple[float, float]]) -> str:
    return ", ".join(f"{n.replace('_', ' ')} {a:.3g} and {b:.3g}" for n, (a, b) in numbers.items())


def _disagreement(numbers: str) -> Doubt:
    why = (
        f"the recordings disagree about the parameters ({numbers}): see whether they are of one machine with "
        "one load, or whether something changed in between"
    )
    return Doubt(None, why, "which recording it is")
