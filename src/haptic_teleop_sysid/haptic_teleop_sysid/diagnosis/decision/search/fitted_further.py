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
    """The choices, the last one with ``fit``, the same effects fitted further, where that gains more than
    recordings need to tell two fits apart, and more on both kinds together; ``baseline``: the structure
    without any of them. The tests of a name are then made with the fit that is reported; its confidence stays
    that of its round. What the currents show keeps its fit, whose size is theirs."""
    *first, last = choices
    old = last.chosen
    if old.by_current > 0.0 or not fit.log_likelihood > old.fit.log_likelihood + CANNOT_TELL:
        return list(choices)
    before = first[-1].chosen.fit if first else baseline
    found = judged(before, [old.fit, fit], estimation, validation, scales)
    was, now = sorted(found, key=lambda e: e.fit is fit)
    if not now.score > was.score:
        return list(choices)
    return [*first, replace(last, chosen=now)]
