"""Parameter constancy: do both kinds of recordings want the same machine?

Where nothing is missing, the structure fitted to the estimation recordings predicts the others as well as the
same structure fitted to them.  Two robots of one kind, a payload that was changed in between, or a drive that
was warm on one day only differ in parameters: no physics is missing in either recording, and no number is
true of both.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from haptic_teleop_sysid.estimation.gauss_newton import Fit
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.whole_fit import fit_whole

from ..evidence.certainty import standard_errors
from ..evidence.held_out import held_out_fit
from ..policy import ANOTHER_MACHINE, ONLY_HERE
from .reasons import Doubt

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
    before, after = baseline.model.parameter_values(), own.model.parameter_values()
    errors = standard_errors(baseline), standard_errors(own)
    differing = [
        name
        for name in baseline.free
        if abs(after[name] - before[name]) > ANOTHER_MACHINE * abs(before[name])
        and abs(after[name] - before[name]) > _APART * float(np.hypot(errors[0][name], errors[1][name]))
    ]
    if not differing:
        return None
    numbers = ", ".join(f"{n.replace('_', ' ')} {before[n]:.3g} and {after[n]:.3g}" for n in differing)
    why = (
        f"the recordings disagree about the parameters ({numbers}, estimation and validation): see whether "
        "they are of one machine with one load, or whether something changed in between"
    )
    return Doubt(None, why, "which recording it is")
