"""How the input of a log acts between its samples.

A controller's command acts from its sample to the next, and so is every input taken here. A log may hold
something else: a torque that was measured when the angles were, or a signal that changes all the time. Half
a sample lies between the two, and passed for a wrong stamp of the input where nothing was wrong. Only the
writer of a log knows, so the recordings are asked which of the two the structure predicts better.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.records import records_from, thinned_to
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch
from haptic_teleop_sysid.recordings.dataset import DataSet

from ..policy import CLEAR_GAIN
from .scales import recording_scales, within_reach

FloatArray = NDArray[np.float64]

#: Sample periods between which a wrong stamp is about half a one.
_LEAST, _MOST = 0.25, 0.75
TOLD = (
    "the input of this log is taken as read at its samples, and smooth between them: so less is missing "
    "than with an input that acts from its sample to the next"
)


def may_be_read(*several: Sequence[DataSet]) -> bool:
    """Whether nobody has said of any recording how its input acts: of imported logs, taken as they came, and
    of bags that hold an effort beside the angles and no command."""
    every = [d for sets in several for d in sets]
    return all(not d.input_read and (_imported(d) or _measured_alone(d)) for d in every)


def _imported(data: DataSet) -> bool:
    return data.experiment.get("kind") == "imported"


def _measured_alone(data: DataSet) -> bool:
    return data.input_source == "measured effort" and data.commanded_input is None


def half_a_sample(effects: Iterable[Effect], dt: float) -> bool:
    """Whether one of the effects is a wrong stamp by about half a sample period ``dt``, s: as much as lies
    between the two."""
    return any(
        e.entry.kind == "skew" and any(_LEAST < abs(v) / dt < _MOST for v in e.parameters.values())
        for e in effects
    )


def as_read(data: DataSet) -> DataSet:
    """The data set with its input smooth between samples: its mean from each to the next, along the cubic
    through the four samples around; straight at either end."""
    command = None if data.commanded_input is None else _means(data.commanded_input)
    problems = (*data.problems, TOLD)
    return replace(
        data, input=_means(data.input), commanded_input=command, problems=problems, input_read=True
    )


def _means(values: FloatArray) -> FloatArray:
    means = 0.5 * (values + np.append(values[1:], values[-1:]))
    means[1:-2] = (13.0 * (values[1:-2] + values[2:-1]) - values[:-3] - values[3:]) / 24.0
    return means


def predicted_better(model: Model, data: Sequence[DataSet]) -> bool:
    """Whether the model predicts recordings clearly better with their input `as_read`."""
    likelihoods = []
    for sets in (data, [as_read(d) for d in data]):
        records = thinned_to([r for d in sets for r in records_from(d, commanded=True)])
        limits = within_reach(model, recording_scales(model, records))
        likelihoods.append(fit_from_scratch(model, records, limits=limits).log_likelihood)
    held, read = likelihoods
    return bool(np.isfinite(read) and read > held + CLEAR_GAIN)
