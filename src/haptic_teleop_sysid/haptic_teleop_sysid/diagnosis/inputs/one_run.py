"""Are two recordings of one run, written by two loggers, cut or resampled? Then one proves nothing of the
other. No two runs of a machine are alike to an encoder's step and in their input."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from haptic_teleop_sysid.estimation.records import smallest_step
from haptic_teleop_sysid.recordings.damage import encoder_step
from haptic_teleop_sysid.recordings.dataset import DataSet

from .scales import bridged

FloatArray = NDArray[np.float64]

#: Fewest samples of what two recordings share, and its length, s.
_FEWEST, _SECONDS = 200, 2.0
#: Steps of the encoder by which angles of one run may differ, rms: a coarser logger rounds, and interpolation
#: adds half of one; least share of the travel that counts as one, where no step is seen; and share of its rms
#: by which the inputs may. By hand: five disguises of a recording are within them, no two runs of 325 sets of
#: recordings of real and simulated joints.
_STEPS, _LEAST, _INPUT = 1.5, 1e-5, 0.03
#: Share of the change from sample to sample below which third differences are scatter and no motion.
_SEEN = 0.003
#: Steps by which the angle must move meanwhile, and share of it that a straight line must leave.
_MOVES, _BENT = 50.0, 0.02


def with_one_run_told(*kinds: Sequence[DataSet]) -> list[list[DataSet]]:
    """The recordings of each kind (to fit to, to choose by, to show), with a sentence where the readings of
    one are those of an earlier kind's once more."""
    found, before = list[list[DataSet]](), list[DataSet]()
    for kind in kinds:
        found.append([_told(one, before) for one in kind])
        before += kind
    return found


def _told(one: DataSet, others: Sequence[DataSet]) -> DataSet:
    for other in others:
        seconds = shared_seconds(one, other)
        if seconds is not None:
            problem = (
                f"for {seconds:.3g} s its angle is that of {other.name} to within the encoder's steps, and "
                "its input is the same: if both are of one run, the one proves nothing of the other"
            )
            return replace(one, problems=(*one.problems, problem))
    return one


def shared_seconds(one: DataSet, other: DataSet) -> float | None:
    """How long, s, two recordings read the same run; None where they do not."""
    dt = max(one.dt, other.dt)
    (angle, input_), (theirs, their_input) = (_at_rate(d, dt) for d in (one, other))
    if min(len(angle), len(theirs)) < max(_FEWEST, round(_SECONDS / dt)):
        return None
    lag = _best_lag(np.diff(angle), np.diff(theirs))
    begin, end = max(lag, 0), min(len(theirs) + lag, len(angle))
    if end - begin < max(_FEWEST, round(_SECONDS / dt)):
        return None
    own, its = slice(begin, end), slice(begin - lag, end - lag)
    travel = float(np.ptp(angle[own]))
    step = max(*(_step(d) for d in (one, other)), _LEAST * travel)
    if not travel > _MOVES * step or _straight(angle[own]):
        return None
    away, apart = _away(angle[own], theirs[its]), _away(input_[own], their_input[its])
    driven = float(np.std(input_[own]))
    return (end - begin) * dt if away < _STEPS * step and apart < _INPUT * driven else None


def _away(one: FloatArray, other: FloatArray) -> float:
    """By how much, rms, two signals differ beside an offset and a part of a sample between their clocks."""
    columns = np.column_stack([np.gradient(other), np.ones(len(other))])
    apart = one - other
    return float(np.std(apart - columns @ np.linalg.lstsq(columns, apart, rcond=None)[0]))


def _step(dataset: DataSet) -> float:
    """The least step of the encoder, between any two readings (from one to the next there may be many), or
    what readings scatter by in third differences, where a motion that is sampled often has none of these."""
    step = encoder_step(np.unique(dataset.motor_position))
    scatter = smallest_step(dataset.motor_position)
    return scatter if scatter < _SEEN * float(np.nanstd(np.diff(dataset.motor_position))) else step


def _at_rate(dataset: DataSet, dt: float) -> tuple[FloatArray, FloatArray]:
    """Angle and input at samples ``dt`` apart."""
    time = dataset.dt * np.arange(len(dataset))
    at = np.arange(0.0, time[-1], dt) if len(time) else time
    angle = bridged(dataset.motor_position) if np.any(np.isfinite(dataset.motor_position)) else time
    return np.interp(at, time, angle), np.interp(at, time, np.nan_to_num(dataset.input))


def _best_lag(one: FloatArray, other: FloatArray) -> int:
    """Samples by which ``other`` begins later in ``one``, by the largest cross-correlation."""
    found = scipy.signal.correlate(one - one.mean(), other - other.mean(), method="fft")
    return int(scipy.signal.correlation_lags(len(one), len(other))[np.argmax(found)])


def _straight(angle: FloatArray) -> bool:
    """Whether an angle is nearly a straight line: any two are alike."""
    return bool(np.std(scipy.signal.detrend(angle)) < _BENT * np.std(angle))
