"""When something acts that has no name: at which times, while the joint does what, at which frequency."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import (
    after_settling,
    channels,
    innovation_covariance,
    innovations,
    seen,
    settling,
)
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.whitening import whiten

from .residual import left_over
from .whiteness import ROUNDING

FloatArray = NDArray[np.float64]

#: Length of the stretches whose power is compared, s.
STRETCH = 0.1
#: A stretch stands out by this many spreads of the others, and by this factor over the middle one.
STANDS_OUT, AT_LEAST = 8.0, 3.0
#: Most of the time that is still "at some times", and the least share of what is left that acts then.
SOMETIMES, MOSTLY = 0.25, 0.4
#: Probability that a quantity is larger (or smaller) in a stretch that stands out than in another one, from
#: which it says when.
TELLS = 0.9
#: Share of a gain that must lie in the calm part of the time (1 - SOMETIMES of it, which is what a steady one
#: has there) for what acts all the time, and log-likelihood a sample that it must be: errors a fifth smaller.
#: By hand, on a motor bench whose delay stood beside one bad reading; a current limit that folds back and a
#: loose contact passed for a plain limit without the second.
EVENLY, FIRMLY = 0.5, 0.22
#: Factor over its surroundings by which one frequency stands out: of white innovations one in 10^17 does.
LINE = 40.0
#: Factor over the level of white innovations that few of their frequencies exceed, and share of what does
#: that a single one must hold.
EXCEEDS, LINE_HOLDS = 6.0, 0.3
#: Length of a moment, s; share of the gain that must lie in it, and gain (nats) worth asking.
MOMENT, ALL_OF_IT, ENOUGH = 0.5, 0.8, 20.0
#: Frequencies (of those that the recording resolves) on either side that the surroundings are taken from, and
#: that belong to one line.
_AROUND, _WIDTH = 50, 3
#: Tones of a command up to which their multiples may be its answer; a multisine has multiples everywhere.
_FEW_TONES = 4


@dataclass(frozen=True)
class Bursts:
    """What stands out on all recordings: ``intervals`` (start, end), s, on each of them, and the
    ``condition`` in words: the quantity that is unusual then, or time."""

    intervals: tuple[tuple[tuple[float, float], ...], ...]
    condition: str


def bursts(fits: Sequence[tuple[Fit, Sequence[Record]]]) -> Bursts | None:
    """When the observer is surprised, if it is so on every recording of all (fit, recordings) at some times
    and hardly at others; None otherwise."""
    found, inside, outside = [], [], []
    for fit, records in fits:
        for record in records:
            one = _stretches(fit, record)
            if one is None:
                return None
            found.append(one[0])
            inside.append(one[1])
            outside.append(one[2])
    if not found:
        return None
    return Bursts(tuple(found), _condition(inside, outside))


def _stretches(
    fit: Fit, record: Record
) -> tuple[tuple[tuple[float, float], ...], dict[str, FloatArray], dict[str, FloatArray]] | None:
    """Intervals that stand out, and rms of the joint's quantities in their stretches and in the others."""
    power = _whitened(fit, record) ** 2
    size = max(round(STRETCH / record.dt), 5)
    count = len(power) // size
    if count < 20:
        return None
    parts = np.max(power[: count * size].reshape(count, size, -1).mean(axis=1), axis=1)
    middle = float(np.median(parts))
    spread = 1.4826 * float(np.median(np.abs(parts - middle)))
    strong = parts > max(middle + STANDS_OUT * spread, AT_LEAST * middle)
    excess = np.maximum(parts - middle, 0.0)
    if not strong.any() or np.mean(strong) > SOMETIMES or excess[strong].sum() < MOSTLY * excess.sum():
        return None
    start = record.start + settling(record) * record.dt
    edges = np.flatnonzero(np.diff(np.concatenate([[0], strong.astype(np.int8), [0]]))).reshape(-1, 2)
    intervals = tuple(
        (round(float(start + a * size * record.dt), 3), round(float(start + b * size * record.dt), 3))
        for a, b in edges.tolist()
    )
    quantities = left_over(fit, record).quantities
    quantities["change of the input"] = np.gradient(quantities["input torque"]) / record.dt
    inside, outside = {}, {}
    for name, values in quantities.items():
        if name != "time":
            x = np.asarray(after_settling(record, values))[: count * size].reshape(count, size)
            rms = np.sqrt(np.mean(x**2, axis=1))
            inside[name], outside[name] = rms[strong], rms[~strong]
    return intervals, inside, outside


def _condition(inside: list[dict[str, FloatArray]], outside: list[dict[str, FloatArray]]) -> str:
    """What is large or small on every recording when something stands out, else time."""
    best, condition = TELLS, "time"
    for name in inside[0]:
        larger = [
            float(np.mean(a[name][:, None] > b[name][None, :])) for a, b in zip(inside, outside, strict=True)
        ]
        for how, told in (("large", min(larger)), ("small", min(1.0 - p for p in larger))):
            if told > best:
                best, condition = told, f"{how} {name}"
    return condition


def steady_line(fits: Sequence[tuple[Fit, Sequence[Record]]]) -> float | None:
    """The frequency, Hz, at which most of what is left acts on every recording, although the input does not
    stand out there; None where there is none."""
    common: list[float] | None = None
    for fit, records in fits:
        for record in records:
            here = _lines(_whitened(fit, record), np.asarray(after_settling(record, record.input)), record.dt)
            near = 1.5 / (len(record) * record.dt)
            common = here if common is None else [f for f in common if any(abs(f - g) < near for g in here)]
            if not common:
                return None
    return common[0] if common else None


def _lines(errors: FloatArray, drive: FloatArray, dt: float) -> list[float]:
    """Frequencies, Hz, strongest first, that stand out of the spectrum of the errors (n, channels)."""
    window = np.hanning(len(errors))[:, None]
    power = np.sum(np.abs(np.fft.rfft(window * (errors - errors.mean(axis=0)), axis=0)) ** 2, axis=1)
    around = scipy.ndimage.median_filter(power, 2 * _AROUND + 1, mode="nearest") / np.log(2.0)
    driven = np.abs(np.fft.rfft(window[:, 0] * (drive - drive.mean()))) ** 2
    usual = scipy.ndimage.median_filter(driven, 2 * _AROUND + 1, mode="nearest")
    out = (power > LINE * around) & ~((driven > LINE * usual) & (driven > 1e-6 * driven.max()))
    white = float(np.median(power)) / np.log(2.0)
    left = float(np.sum(power[power > EXCEEDS * white]))
    frequency = np.fft.rfftfreq(len(errors), dt)
    # What a nonlinearity makes of a command of one or few frequencies are their multiples.
    strong: list[int] = np.flatnonzero(driven > 0.1 * driven.max()).tolist()
    tones = [k for k in strong if k > 0 and driven[k] == driven[_near(k)].max()]
    found = []
    for k in sorted(np.flatnonzero(out).tolist(), key=lambda k: -power[k]):
        if len(tones) <= _FEW_TONES and any(abs(k / t - round(k / t)) * t < _WIDTH for t in tones):
            continue
        near = _near(k)
        if power[k] == power[near].max() and power[near].sum() > LINE_HOLDS * left:
            found.append(float(frequency[k]))
    return found


def _near(k: int) -> slice:
    """The frequencies that belong to the line at number ``k``."""
    return slice(max(k - _WIDTH, 0), k + _WIDTH + 1)


def _whitened(fit: Fit, record: Record) -> FloatArray:
    """Settled innovations (n, channels) in units of what they usually are."""
    packed = pack(fit.model)
    used = channels(packed, record)
    e = after_settling(record, innovations(packed, fit.noise, record).innovation)[:, used]
    read = after_settling(record, seen(packed, record))[:, used] & np.isfinite(e)
    usual = [np.median(np.abs(e[one, c])) if one.any() else 0.0 for c, one in enumerate(read.T)]
    least = np.sqrt(ROUNDING) * np.array(record.resolution)[used]
    return np.where(read, e, 0.0) / np.maximum(1.4826 * np.array(usual), least)


def moment(before: Fit, after: Fit, records: Sequence[Record]) -> float | None:
    """The time, s, around which (MOMENT s) nearly all is gained by ``after`` over ``before``; None where it
    is gained at several times, or hardly anything is."""
    best, total, when = 0.0, 0.0, 0.0
    for record in records:
        gain = _nats(before, record) - _nats(after, record)
        size = max(round(MOMENT / record.dt), 1)
        sums = np.concatenate([[0.0], np.cumsum(gain)])
        over = sums[size:] - sums[:-size] if len(sums) > size else sums[-1:]
        total += float(sums[-1])
        k = int(np.argmax(over))
        if over[k] > best:
            best, when = float(over[k]), record.start + (settling(record) + k + 0.5 * size) * record.dt
    seconds = sum(len(r) * r.dt for r in records)
    return when if total > ENOUGH and best > ALL_OF_IT * total and seconds > 10.0 * MOMENT else None


def all_the_time(before: Fit, after: Fit, records: Sequence[Record]) -> bool:
    """Whether ``after`` errs clearly less than ``before`` on every record, and at other times, too, than
    those (SOMETIMES of all) at which it errs most: then what acts at some times is something else."""
    for record in records:
        gain = _nats(before, record) - _nats(after, record)
        power = np.max(_whitened(after, record) ** 2, axis=1)
        size = max(round(STRETCH / record.dt), 5)
        count = len(gain) // size
        if count < 20:
            return False
        parts = gain[: count * size].reshape(count, size).sum(axis=1)
        errs = power[: count * size].reshape(count, size).mean(axis=1)
        calm = np.argsort(errs)[: round((1.0 - SOMETIMES) * count)]
        whole = float(parts.sum())
        if not (whole > FIRMLY * len(gain) and float(parts[calm].sum()) > EVENLY * whole):
            return False
    return True


def _nats(fit: Fit, record: Record) -> FloatArray:
    """Negative log-likelihood of each settled sample (n,), but for a constant; 0 where nothing was read."""
    packed = pack(fit.model)
    errors = innovations(packed, fit.noise, record).innovation
    spread = innovation_covariance(packed, record, errors)
    whitened, _ = whiten(packed, record, errors, np.zeros((len(record), 2, 0)))
    read = after_settling(record, seen(packed, record))[:, : len(spread)]
    # One encoder alone by its own variance, both by their covariance.
    size = read @ np.log(np.diag(spread))
    size[read.all(axis=1)] = np.linalg.slogdet(spread)[1]
    return 0.5 * np.sum(whitened.reshape(len(read), -1) ** 2, axis=1) + 0.5 * size
