"""A data set as the predictor wants it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.robots import OMNI_RESOLUTION, SFJ_STAGES
from haptic_teleop_sysid.recordings.damage import encoder_step
from haptic_teleop_sysid.recordings.dataset import DataSet

FloatArray = NDArray[np.float64]
LONGEST_HOLE = 5
"""Samples without reading over which the predictor just runs on."""
FIRST_SECONDS = 0.05
"""s of readings that show the speed at the first of them."""
SHORTEST_PIECE = 100
"""Samples between two holes that are worth a start of the observer."""


@dataclass(frozen=True)
class Record:
    """One recording of one joint.

    ``input`` (n,): A (sfj) or N·m, held from each sample to the next; ``measured`` (n, 2): motor and arm
    angle, rad, NaN where missing; ``exogenous`` (n,): the other arm's acceleration, rad/s^2;
    ``resolution``: rad, step of either encoder, or the rms of its noise where no step is known.
    ``at_rest``: the joint is known to rest at the first sample, which then counts like every other;
    otherwise the observer is given time to find out, beginning with the angles first read, and ``offsets``,
    rad, and the speeds ``rates`` of motor and arm, rad/s. ``start``: s, time of the first sample, from which
    effects that depend on time count. ``moment`` (n,): of the input within each sample, in its unit times s²
    (see `acting`), where it is the mean of one that changed faster. ``input_noise``: rms of what a measured
    input scatters by from sample to sample, in its unit; 0 of a command.
    """

    name: str
    dt: float
    input: FloatArray
    measured: FloatArray
    exogenous: FloatArray
    resolution: tuple[float, float]
    at_rest: bool = False
    start: float = 0.0
    rates: tuple[float, float] = (0.0, 0.0)
    moment: FloatArray | None = None
    offsets: tuple[float, float] = (0.0, 0.0)
    input_noise: float = 0.0

    def __len__(self) -> int:
        return len(self.input)

    @cached_property
    def read(self) -> NDArray[np.bool_]:
        """Which readings there are, (n, 2); not to be written to."""
        found = np.isfinite(self.measured)
        found.flags.writeable = False
        return found

    @cached_property
    def readings(self) -> tuple[int, int]:
        """How many there are of motor and arm."""
        return int(np.count_nonzero(self.read[:, 0])), int(np.count_nonzero(self.read[:, 1]))

    def initial_state(self) -> FloatArray:
        """Angles and speeds of motor and arm (which the observer corrects within some samples)."""
        first = self.measured[0]
        motor = float(np.nan_to_num(first[0]))
        arm = float(first[1]) if np.isfinite(first[1]) else motor
        return np.array([motor + self.offsets[0], arm + self.offsets[1], *self.rates])


def thinned(record: Record, rate: float) -> Record:
    """Every k-th reading, and of the input over the k samples that follow the mean and the moment, k as large
    as leaves at least `rate`, Hz; the record itself where that is 1. Good enough to come near, not to arrive.

    Without the moment the mean acts at the wrong time within the k samples, and so like a delay."""
    k = int(1.0 / (record.dt * rate) + 1e-6)
    n = len(record) // max(k, 1)
    if k < 2 or n < 2:
        return record
    blocks = slice(0, n * k)
    whole = record.input[blocks].reshape(n, k)
    left = record.dt * (k - 0.5 - np.arange(k))  # of the time of a block, at the middle of each sample
    mean = whole.mean(axis=1)
    return replace(
        record,
        dt=k * record.dt,
        input=mean,
        moment=record.dt * ((whole - mean[:, None]) @ left),
        measured=record.measured[blocks][::k].copy(),
        exogenous=record.exogenous[blocks].reshape(n, k).mean(axis=1),
    )


#: Samples in all, and rate, Hz, to which long recordings are thinned for what is to come near only.
ENOUGH_SAMPLES, LEAST_RATE = 8000, 200.0


def thinning(samples: int, dt: float, least_rate: float = LEAST_RATE, share: float = 1.0) -> float:
    """Rate, Hz, to which recordings of so many samples in all, the fastest every ``dt`` s, are thinned."""
    return max(LEAST_RATE, least_rate, share * ENOUGH_SAMPLES / (samples * dt))


def thinned_to(records: Sequence[Record], share: float = 1.0) -> Sequence[Record]:
    """The recordings, `thinned` to less than twice ENOUGH_SAMPLES (or a ``share`` of that) in all, but no
    further than to LEAST_RATE; ``records`` itself where nothing is thinned."""
    total = sum(len(r) for r in records)
    if total <= share * ENOUGH_SAMPLES:
        return records
    found = [thinned(r, thinning(total, r.dt, share=share)) for r in records]
    return records if all(a is b for a, b in zip(found, records, strict=True)) else found


def record_from(data: DataSet, commanded: bool = False) -> Record:
    """The record of a data set; invalid samples as missing readings.

    The input is the commanded one where the amplifier follows it (it carries no sensor noise, which matters
    in a closed loop), otherwise the measured one.  ``commanded`` takes the command wherever it was
    recorded: then what the actuator makes of it is part of what has to be explained.
    """
    noise = _scatter(data.input) if data.commanded_input is None else 0.0
    data = with_trusted_input(data, commanded)
    measured = np.full((len(data), 2), np.nan)
    measured[:, 0] = data.motor_position
    if data.arm_position is not None:
        measured[:, 1] = data.arm_position
    if len(data.valid):
        measured[~data.valid] = np.nan
    exogenous = np.zeros(len(data)) if data.exogenous is None else data.exogenous
    return Record(
        data.name,
        data.dt,
        np.ascontiguousarray(data.input),
        measured,
        np.ascontiguousarray(exogenous),
        _resolution(data, measured),
        start=data.start,
        input_noise=noise,
    )


def _scatter(values: FloatArray) -> float:
    """Rms of the white noise in values (n,) of a smooth signal, or of one in steps: of third differences,
    whose variance is 20 times that of the noise, the median, which steps do not move."""
    third = np.abs(np.diff(values[np.isfinite(values)], 3))
    return 1.4826 * float(np.median(third)) / np.sqrt(20.0) if len(third) else 0.0


def records_from(data: DataSet, at_rest: bool = False, commanded: bool = False) -> list[Record]:
    """The record of a data set, cut apart at holes longer than LONGEST_HOLE samples, because what acts in a
    hole unseen would come out as one huge error behind it. Pieces shorter than SHORTEST_PIECE are left out,
    unless there is no other. The first begins at rest, on which the observer need not rely unless `at_rest`;
    one behind a hole begins with the speed that its first readings show. ``commanded``: see `record_from`."""
    whole = record_from(data, commanded)
    seen = np.flatnonzero(np.isfinite(whole.measured[:, 0]))
    ends = np.flatnonzero(np.diff(seen) > LONGEST_HOLE)
    spans = list(zip(seen[np.r_[0, ends + 1]], seen[np.r_[ends, len(seen) - 1]] + 1, strict=True))
    kept = [s for s in spans if s[1] - s[0] >= SHORTEST_PIECE] or [max(spans, key=lambda s: s[1] - s[0])]
    return [piece(whole, a, b, at_rest and a == 0) for a, b in kept]


def piece(whole: Record, first: int, stop: int, at_rest: bool = False) -> Record:
    """The samples ``first`` to ``stop`` of a record, which begins as that does where it is its beginning."""
    measured = whole.measured[first:stop]
    begins = (whole.rates, whole.offsets) if first == 0 else (_first_speeds(measured, whole.dt), (0.0, 0.0))
    rates, offsets = ((0.0, 0.0), (0.0, 0.0)) if at_rest else begins
    return replace(
        whole,
        input=whole.input[first:stop],
        measured=measured,
        exogenous=whole.exogenous[first:stop],
        at_rest=at_rest,
        start=whole.start + first * whole.dt,
        rates=rates,
        offsets=offsets,
    )


def _first_speeds(measured: FloatArray, dt: float) -> tuple[float, float]:
    """Speeds of motor and arm at the first sample: slopes of parabolas through the first FIRST_SECONDS."""
    part = measured[: max(round(FIRST_SECONDS / dt), 5)]
    time = dt * np.arange(len(part))
    speeds = []
    for angle in part.T:
        good = np.isfinite(angle)
        speeds.append(float(np.polyfit(time[good], angle[good], 2)[1]) if np.sum(good) > 3 else np.nan)
    motor = speeds[0] if np.isfinite(speeds[0]) else 0.0
    return motor, speeds[1] if np.isfinite(speeds[1]) else motor


def with_trusted_input(data: DataSet, commanded: bool = False) -> DataSet:
    """The data set with the commanded input as its input where the amplifier followed it, or wherever it was
    recorded (``commanded``): it carries neither noise nor offset of the current sense."""
    if data.commanded_input is None:
        return data
    if commanded:
        return replace(data, input=data.commanded_input, input_source="commanded effort")
    difference = float(np.std(data.commanded_input - data.input))
    # 15 mA is what the current sense of these amplifiers shows by itself (facts A3: 5 to 16 mA rms).
    if difference > max(0.05 * float(np.std(data.input)), 0.015 if data.input_unit == "A" else 0.0):
        return data
    return replace(data, input=data.commanded_input, input_source="commanded effort")


def _resolution(data: DataSet, measured: FloatArray) -> tuple[float, float]:
    if data.robot in ("sfj", "omni"):
        known = (OMNI_RESOLUTION, OMNI_RESOLUTION)
        if data.robot == "sfj":
            facts = SFJ_STAGES[data.joint]
            known = (facts.drive_resolution, facts.joint_resolution)
        # Another encoder may be coarser than the one that is usual there.
        seen = [encoder_step(measured[:, channel], SHORTEST_PIECE) for channel in (0, 1)]
        return max(known[0], seen[0]), max(known[1], seen[1])
    found = [smallest_step(measured[:, channel]) for channel in (0, 1)]
    return found[0], found[1]


def smallest_step(angle: FloatArray) -> float:
    """The step of an encoder (rad) from its readings: the smallest difference that occurs, but at least the
    noise seen in third differences of a smooth motion."""
    good = angle[np.isfinite(angle)]
    if len(good) < 10:
        return 1.0
    steps = np.abs(np.diff(good))
    steps = steps[steps > 1e-12]
    step = float(np.min(steps)) if len(steps) else 1e-6
    noise = float(np.std(np.diff(good, 3))) / np.sqrt(20.0)
    return max(step, noise * np.sqrt(12.0) * 0.2, 1e-9)
