"""Do recordings belong together, and does their input drive the joint?  Asked of band-limited inverse
dynamics before anything is fitted.

The torque that a motion takes, J a + b v + Fc sign v + k q + g sin(q + q0) + k_s (q - q_arm) + c, is linear
in what is unknown. A regression of the input on it, with all terms filtered as the input is (Gautier and
Khalil 1990), says of each recording how much of its input the motion explains, and how large the input of
another one is by its numbers.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.recordings.median_frequency import median_periods

from ..inputs.scales import bridged
from .inverse_dynamics.motion import low_passed

FloatArray = NDArray[np.float64]
#: Of a recording: its input (n,), and the terms (n, k) that its motion makes of it; see `terms`.
Part = tuple[FloatArray, FloatArray]
#: Cut-off of the filter, Hz, and as a share of the sampling rate.
_BAND, _SHARE = 8.0, 0.1
#: Velocity, relative to the largest, within which its sign is smoothed.
_SMOOTH = 0.02
#: Share of its input that a motion must explain for its numbers to judge another recording.
_EXPLAINS = 0.5
#: Factors between units of angle or effort that are taken for one another, and how near to one (ratio) the
#: sizes of the inputs then come.
_UNITS = {
    180.0 / np.pi: "degrees for radians",
    2.0 * np.pi: "turns for radians",
    100.0: "percent for shares",
    1000.0: "thousandths",
}
_NEAR = 1.25
#: Factor from which two recordings are hardly of one machine: of inputs that the same motion explains, and of
#: inputs that only their own numbers explain. Of 190 pairs of recordings of one machine the latter is 2.2 at
#: most (76 real joints); of pairs of two machines it is above 5 in 41 %.
_ANOTHER, _UNLIKE = 3.0, 5.0
#: Share of what own numbers explain of an input that common ones may miss of either of two recordings. Of two
#: inputs that differ by the factor 3 common numbers miss a quarter of one at least.
_MISSED = 0.15
#: Limits of a drive that are tried, as shares of the largest input.
_LIMITS = np.geomspace(0.9, 0.01, 20)
#: Share of the samples beyond a limit up to which an input is hardly clipped, and the most of it in that of
#: two which is clipped less.
_HARDLY, _MOST_CLIPPED = 0.05, 0.5
#: Stretches that a coherence is averaged over, and the probability of the largest one by chance.
_STRETCHES, _BY_CHANCE = 16, 1e-4
#: Share of an input below which inverse dynamics explains nothing of it.
_NOTHING = 0.2
#: Terms of a torque behind a lag; the band of a motion: so many times the frequency below which half of its
#: velocity's power is, and at least so many periods in a recording. By hand, on a rotor that lifts a beam.
_TERMS, _BANDWIDTH, _PERIODS = 4, 3.0, 8
#: Share of the samples with another value, below which an input is one step, and how often it changes.
_SELDOM, _CHANGES = 0.05, 4


def terms(record: Record) -> tuple[FloatArray, FloatArray]:
    """Band-limited input (n,), and the terms (n, k) that the motion makes of it; without the ends, where the
    filter swings."""
    angle = bridged(record.measured[:, 0])
    cut = min(_BAND, _SHARE / record.dt)

    def filtered(values: FloatArray) -> FloatArray:
        return low_passed(values, record.dt, cut)

    smooth = filtered(angle)
    velocity = np.gradient(smooth, record.dt)
    sign = np.tanh(velocity / max(_SMOOTH * float(np.max(np.abs(velocity))), 1e-300))
    own = [np.gradient(velocity, record.dt), velocity, sign, smooth, np.sin(smooth), np.cos(smooth)]
    if np.any(np.isfinite(record.measured[:, 1])):
        own.append(smooth - filtered(bridged(record.measured[:, 1])))
    columns = [filtered(one) for one in own] + [np.ones(len(angle))]
    inside = slice(round(1.0 / (cut * record.dt)), len(angle) - round(1.0 / (cut * record.dt)))
    return filtered(record.input)[inside], np.column_stack(columns)[inside]


def parts_of(records: Sequence[Record]) -> dict[str, Part]:
    """By name of the recording, the `terms` of all its pieces, each about its own mean."""
    found: dict[str, list[Part]] = {}
    for record in records:
        drive, columns = terms(record)
        if len(drive) <= columns.shape[1]:
            continue  # shorter than the filter swings
        columns = columns[:, :-1]
        found.setdefault(record.name, []).append((drive - drive.mean(), columns - columns.mean(axis=0)))
    return {
        name: (np.concatenate([d for d, _ in pieces]), np.vstack([c for _, c in pieces]))
        for name, pieces in found.items()
    }


def sizes(parts: Sequence[Part]) -> tuple[FloatArray, FloatArray]:
    """How large the input of each recording (row) is by the numbers of each other one (column), in units of
    what it is: 1 where both agree; NaN where the motion does not explain the input of the latter. Second, the
    same where these numbers explain the input of the row but for its size, NaN elsewhere. ``parts``: see
    `parts_of`."""
    found = np.full((len(parts), len(parts)), np.nan)
    same = found.copy()
    for j, (drive, columns) in enumerate(parts):
        numbers = _regressed(columns, drive)
        left = drive - columns @ numbers
        if np.var(left) > (1.0 - _EXPLAINS) * np.var(drive):
            continue
        for i, (other, theirs) in enumerate(parts):
            expected = theirs @ numbers
            lengths = np.linalg.norm(expected), np.linalg.norm(other)
            found[i, j] = lengths[1] / max(lengths[0], 1e-300)
            if float(expected @ other) > np.sqrt(_EXPLAINS) * lengths[0] * lengths[1]:
                same[i, j] = found[i, j]
    return found, same


def alike(one: Part, other: Part) -> bool:
    """Whether common numbers explain either input nearly as well as its own do. Where the two move at other
    angles, or one of them hardly accelerates, the numbers of the one alone say nothing of the other."""
    shares = zip((explained(part) for part in (one, other)), _by_common(one, other), strict=True)
    return all(common >= (1.0 - _MISSED) * own for own, common in shares)


def alike_behind_a_limit(records: Sequence[Record], names: tuple[str, str]) -> bool:
    """Whether two recordings (of these ``names``) are `alike` once both inputs are clipped at a common limit:
    the drive ends there, and one input is large for its motion. Common numbers must leave half of what its
    own leave of a whole input that is clipped, and nearly as much of one that hardly is; one must be, and
    not both mostly: any two inputs are alike as square waves."""
    of = [r for r in records if r.name in names]
    whole = parts_of(of)
    own = [explained(whole[name]) for name in names]
    inputs = [np.concatenate([np.abs(r.input) for r in of if r.name == name]) for name in names]
    for limit in max(float(np.max(one)) for one in inputs) * _LIMITS:
        clipped = [float(np.mean(one > limit)) for one in inputs]
        if min(clipped) > _MOST_CLIPPED or max(clipped) <= _HARDLY:
            continue
        ended = parts_of([replace(r, input=np.clip(r.input, -limit, limit)) for r in of])
        common = _by_common(*(ended[name] for name in names))
        # Half of what is left over, or nearly the same share as before.
        least = [
            0.5 * (1.0 + share) if beyond > _HARDLY else (1.0 - _MISSED) * share
            for share, beyond in zip(own, clipped, strict=True)
        ]
        if all(share > needed for share, needed in zip(common, least, strict=True)):
            return True
    return False


def explained(part: Part) -> float:
    """Share of a recording's input that its own numbers explain."""
    drive, columns = part
    left = drive - columns @ _regressed(columns, drive)
    return 1.0 - float(np.var(left) / max(float(np.var(drive)), 1e-300))


def _by_common(one: Part, other: Part) -> list[float]:
    """Share of the input of each of two recordings that numbers fitted to both explain."""
    both = [(drive / _spread(drive), columns / _spread(drive)) for drive, columns in (one, other)]
    rows = [(drive / np.sqrt(len(drive)), columns / np.sqrt(len(drive))) for drive, columns in both]
    common = _regressed(np.vstack([c for _, c in rows]), np.concatenate([d for d, _ in rows]))
    return [1.0 - float(np.var(drive - columns @ common)) for drive, columns in both]


def _spread(values: FloatArray) -> float:
    return max(float(np.std(values)), 1e-300)


def _regressed(columns: FloatArray, drive: FloatArray) -> FloatArray:
    scale = np.maximum(np.sqrt(np.mean(columns**2, axis=0)), 1e-300)
    # By a pivoted QR decomposition, which does not iterate and cannot fail to converge.
    return np.asarray(scipy.linalg.lstsq(columns / scale, drive, cond=1e-9, lapack_driver="gelsy")[0] / scale)


def refuse_other_units(records: Sequence[Record]) -> None:
    """Raise RecordingError for two recordings of which common numbers explain both only after the input or
    the angle of one of them is multiplied by the factor between two units, or its input by one so large that
    they are hardly of one machine; or of which each is far too large by the numbers of the other, and the
    other too small by its own. One step of the input says too little to be compared."""
    records = [r for r in records if not _one_step(r.input)]
    by_name = parts_of(records)
    names, parts = [*by_name], [*by_name.values()]
    every, same = sizes(parts)
    for i in range(len(parts)):
        for j in range(i):
            ratios = [r for r in (same[i, j], 1.0 / same[j, i]) if np.isfinite(r)]
            apart = len(ratios) > 0 and min(max(r, 1.0 / r) for r in ratios) >= _ANOTHER
            other = unlike(every[i, j], every[j, i])
            if not (apart or other) or alike(parts[i], parts[j]):
                continue
            if alike_behind_a_limit(records, (names[i], names[j])):
                continue
            ratios = ratios or [every[i, j], 1.0 / every[j, i]]
            ratio = float(np.exp(np.mean(np.log(ratios))))
            what = _as_units([r for r in records if r.name == names[i]], parts[j])
            if what is None and (other or alike((parts[i][0] / ratio, parts[i][1]), parts[j])):
                what = "so they are hardly of one machine"
            if what is not None:
                raise RecordingError(
                    f"for the same motion the input of {names[i]} is {ratio:.3g} times that of {names[j]}, "
                    f"{what}: diagnose recordings of one machine, in the same units."
                )


def refuse_other_signs(records: Sequence[Record]) -> None:
    """Raise RecordingError for two recordings of which the input of one is by the numbers of the other what
    it is but for its sign, and common numbers explain both only with the sign turned."""
    by_name = parts_of([r for r in records if not _one_step(r.input)])
    numbers = {
        name: _regressed(columns, drive)
        for name, (drive, columns) in by_name.items()
        if explained((drive, columns)) >= _EXPLAINS
    }
    for (name, part), (other, own) in itertools.product(by_name.items(), numbers.items()):
        drive, columns = part
        expected = columns @ own
        lengths = float(np.linalg.norm(expected)) * float(np.linalg.norm(drive))
        if name == other or float(expected @ drive) >= -np.sqrt(_EXPLAINS) * lengths:
            continue
        theirs = by_name[other]
        if alike((-drive, columns), theirs) and not alike(part, theirs):
            raise RecordingError(
                f"for the same motion the input of {name} has the other sign than that of {other}: turn one "
                "of them (in a mapping, a gain of -1), or see which way and from where both count."
            )


def unlike(one: float, other: float) -> bool:
    """Whether the input of each of two recordings is by _UNLIKE too large, and too small, by the numbers of
    the other one (see `sizes`). Numbers of a motion that hardly knows them are too large either way."""
    larger, smaller = max(one, 1.0 / other), min(one, 1.0 / other)
    return bool(smaller > _UNLIKE or larger < 1.0 / _UNLIKE)


def _as_units(records: Sequence[Record], other: Part) -> str | None:
    """Between which units the recordings of one name differ from another one, in words, if they do."""
    for unit, words in _UNITS.items():
        for factor, name in itertools.product((unit, 1.0 / unit), ("input", "measured")):
            scaled = [replace(r, **{name: factor * getattr(r, name)}) for r in records]
            (part,) = parts_of(scaled).values()
            ratio = sizes([part, other])[1][0, 1]
            if 1.0 / _NEAR < ratio < _NEAR and alike(part, other):
                return f"as if one of them had another unit ({words})"
    return None


def _one_step(values: NDArray[np.float64]) -> bool:
    """Whether an input (n,) has one value nearly all of the time and hardly changes: it varies too seldom
    to be compared."""
    away = values != np.median(values)
    return bool(np.mean(away) < _SELDOM and np.count_nonzero(np.diff(values)) <= _CHANGES)


def refuse_unrelated(record: Record, joint: str) -> None:
    """Raise RecordingError for an input that has nothing in common with the motion: at no frequency, by no
    torque that inertia, friction, a spring or gravity would take, and by none in the band of the motion,
    which may be slower than the stretches of a coherence, and behind a slow drive."""
    size = len(record) // (_STRETCHES // 2)
    motion = np.gradient(bridged(record.measured[:, 0]))
    if np.std(motion) <= 0.0 or size < 32 or _one_step(record.input):
        return
    _, shared = scipy.signal.coherence(record.input, motion, nperseg=size, noverlap=size // 2)
    largest = float(np.max(shared[1:]))
    # Of unrelated signals with K independent stretches it exceeds c with probability (1 - c)^(K - 1).
    independent = _STRETCHES / 2 * 1.5
    by_chance = 1.0 - (_BY_CHANCE / len(shared)) ** (1.0 / (independent - 1.0))
    if largest >= by_chance:
        return
    share = explained(terms(record))
    if share < _NOTHING and _behind_a_lag(record) < _NOTHING:
        raise RecordingError(
            f"{record.name}: the input has nothing in common with the motion of {joint}: at no frequency "
            f"(largest coherence {largest:.2f}), and what such a motion takes explains {100.0 * share:.0f} % "
            "of it. See whether it is what drives this joint, and whether both have one clock."
        )


def _behind_a_lag(record: Record) -> float:
    """Share of the input, in the band of the motion, that its torque behind a first-order lag explains, less
    what so many terms do by chance. Such an input is (1 + T d/dt) (J a + b v + k q), which is linear in
    angle, velocity, acceleration and jerk. 1 where the recording is too short to say."""
    angle = bridged(record.measured[:, 0])
    cut = max(_BANDWIDTH * median_periods(np.gradient(angle)), _PERIODS) / (len(angle) * record.dt)
    cut = min(cut, _BAND, _SHARE / record.dt)
    motion = [low_passed(angle, record.dt, cut)]
    while len(motion) < _TERMS:
        motion.append(np.gradient(motion[-1], record.dt))
    ends = round(1.0 / (cut * record.dt))
    independent = 2.0 * cut * (len(angle) - 2 * ends) * record.dt
    if independent <= _TERMS + 2:
        return 1.0
    columns = np.column_stack(motion)[ends : len(angle) - ends]
    drive = low_passed(record.input, record.dt, cut)[ends : len(angle) - ends]
    columns, drive = columns - columns.mean(axis=0), drive - drive.mean()
    left = float(np.var(drive - columns @ _regressed(columns, drive)) / max(float(np.var(drive)), 1e-300))
    return 1.0 - left * (independent - 1.0) / (independent - 1.0 - _TERMS)
