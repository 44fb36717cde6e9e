"""A finding whose fit a later round improved: the search for one more effect begins by fitting what is there
again from where its trials ended, which may lead out of a hollow in which the finding's own fit had ended."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.records import Record

from ...evidence.held_out import judged
from ...inputs.scales import Scales
from ...policy import CANNOT_TELL
from .decide import Choice


def fitted_further(
    choices: Sequence[Choice],
    baseline: Fit,
    fit: Fit,
    estimation: Sequence[Record],
    validation: Sequence[Record],
    scales: Scales,
) -> list[Choice]:
    """The choices, the last one with ``fit``, the same effects fitted further, where it gains more than what
    recordings need to tell two fits apart; ``baseline``: the structure without any of them. What the tests
    of a name ask is then asked of the fit that is reported."""
    *first, last = choices
    old = last.chosen
    if not fit.log_likelihood > old.fit.log_likelihood + CANNOT_TELL:
        return list(choices)
    before = first[-1].chosen.fit if first else baseline
    both = {id(e.fit): e for e in judged(before, [old.fit, fit], estimation, validation, scales)}
    was, now = both[id(old.fit)], both[id(fit)]
    chosen = replace(
        old,
        fit=fit,
        gain=old.gain + now.gain - was.gain,
        held_out=old.held_out + now.held_out - was.held_out,
        reconciled=old.reconciled + now.reconciled - was.reconciled,
        material=now.material,
        gains=now.gains,
    )
    return [*first, replace(last, chosen=chosen)]
