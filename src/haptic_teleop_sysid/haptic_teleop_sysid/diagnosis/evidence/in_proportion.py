"""What a torque missing at the motor is in proportion to, by a factor that may change with time.

What an amplifier loses is a share of its input, whatever the joint does: a limit that folds back, a supply
that sags, commands that are lost for a moment, a motor that is weaker at some angles. What a bearing or a
load takes is not. For each quantity x the innovations are regressed on the observer's answer to a torque x(t)
at the motor, with one factor for every stretch of time, so that all quantities have as many factors and their
gains can be compared. What a constant factor explains is taken out before: the structure or a name has that.

In a closed loop the input answers to whatever is missing, a hand that pushes, too, and is in proportion to it
for that reason. So only that part of each quantity counts there that does not follow from the innovations:
what the reference makes of it (see `feedback.exogenous`).

An inertia that changes takes a share of the acceleration, and on a rigid joint that is nearly a share of the
input. Where the acceleration gains clearly more, it is the motor's; where neither does, it may be both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve

from haptic_teleop_sim.kernel import Packed, pack
from haptic_teleop_sysid.estimation.gauss_newton import Fit, whiten
from haptic_teleop_sysid.estimation.likelihood import (
    FAILURES,
    channels,
    covariance,
    innovations,
    seen,
    settled,
)
from haptic_teleop_sysid.estimation.records import Record

from ..inputs.scales import bridged
from .feedback import answers, exogenous

FloatArray = NDArray[np.float64]

INPUT, ACCELERATION = "input", "acceleration"
#: Lengths of the stretches that are tried, s; the shortest are those of a lost command.
STRETCHES = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0)
#: Nats that a factor must gain: half of one by chance, and as much again for what no model has quite right.
BY_CHANCE = 1.0
#: Nats, and share of its gain, by which the input must gain more than any motion to be what a torque is in
#: proportion to. By hand, on 158 cases of six draws by other authors and two seeds of the benchmark.
CLEARLY, CLEARLY_SHARE = 12.0, 0.1
#: Size of the torque by which the observer's answer is found, of the rms input, and times at which it is.
_PUSH, _TIMES = 1e-3, 5
#: Longest answer, s, and its end as a share of its largest value.
_LONGEST, _ENDS = 1.0, 1e-3
#: Share of the largest singular value from which columns count as combinations of others.
_SAME = 1e-8


def in_proportion(fits: Sequence[tuple[Fit, Sequence[Record]]], free: tuple[str, ...]) -> dict[str, float]:
    """The nats that a factor which changes with time gains for each quantity on all recordings together, the
    largest first, net of what it gains by chance, with the best of STRETCHES; {} where arithmetic fails.
    ``fits``: each with its records; ``free``: the parameters that make up for what they can."""
    gains: dict[tuple[str, float], float] = {}
    for fit, records in fits:
        for record in records:
            if not np.any(record.input):
                continue
            try:
                found = _gains(fit, record, free)
            except FAILURES:
                return {}
            for key, gain in found.items():
                gains[key] = gains.get(key, 0.0) + gain
    best: dict[str, float] = {}
    for (name, _), gain in gains.items():
        best[name] = max(gain, best.get(name, -np.inf))
    return dict(sorted(best.items(), key=lambda one: -one[1]))


def with_the_input(gains: dict[str, float], rigid: bool = False) -> bool:
    """Whether what is missing is in proportion to the input, and clearly less so to any motion; on a
    ``rigid`` joint, whose acceleration is nearly the input, to that not clearly more."""
    motion = [gain for name, gain in gains.items() if name != INPUT and not (rigid and name == ACCELERATION)]
    if not motion:
        return False
    own = gains[INPUT]
    if rigid and _clearly_more(gains[ACCELERATION], own):
        return False
    return own > CLEARLY and _clearly_more(own, max(motion))


def _clearly_more(gain: float, other: float) -> bool:
    return gain - other > max(CLEARLY, CLEARLY_SHARE * gain)


def _gains(fit: Fit, record: Record, free: tuple[str, ...]) -> dict[tuple[str, float], float]:
    """What each quantity gains on one recording with stretches of each length, nats."""
    packed = pack(fit.model)
    run = innovations(packed, fit.noise, record, free)
    count = len(channels(packed, record))
    errors, slopes = whiten(packed, record, run.innovation, run.d_innovation)
    answer = _answer(packed, fit, record, run.innovation)
    read = settled(record, seen(packed, record))[:, :count]
    quantities = _quantities(fit, record, run.states)
    if answers(record, run.innovation[:, :count]):
        parts = exogenous(np.column_stack([*quantities.values()]), run.innovation[:, :count], record.dt)
        quantities = dict(zip(quantities, parts.T, strict=True))
    answers_to = {
        name: (settled(record, _convolved(values, answer)) * read).reshape(-1)
        for name, values in quantities.items()
    }
    steady = np.column_stack([slopes, *answers_to.values()])
    length = np.sqrt(np.sum(steady**2, axis=0))
    steady = steady[:, length > 0.0] / length[length > 0.0]
    left = errors - steady @ np.linalg.lstsq(steady, errors, rcond=_SAME)[0]
    found = {}
    for name, values in answers_to.items():
        each = [one.reshape(-1, count).sum(axis=1) for one in (values * left, values**2)]
        for seconds in STRETCHES:
            parts = round(len(read) * record.dt / seconds)
            if parts < 2:
                continue
            starts = np.arange(parts) * len(read) // parts
            along, power = (np.add.reduceat(one, starts) for one in each)
            moved = power > 0.0
            gain = 0.5 * float(np.sum(along[moved] ** 2 / power[moved]))
            found[name, seconds] = gain - BY_CHANCE * int(np.count_nonzero(moved))
    return found


def _answer(packed: Packed, fit: Fit, record: Record, innovation: FloatArray) -> FloatArray:
    """What a unit of input for one sample adds to the innovations (samples, channels) from then on, in units
    of their standard deviation: in the middle of several times, as dry friction holds some of them."""
    used = channels(packed, record)
    read = record.measured.copy()
    for channel in used:
        read[:, channel] = bridged(read[:, channel])
    whole = replace(record, measured=read)
    undisturbed = innovations(packed, fit.noise, whole).innovation
    size = _PUSH * float(np.sqrt(np.mean(record.input**2)))
    longest = min(round(_LONGEST / record.dt), len(record) // (_TIMES + 1))
    found = []
    for time in range(1, _TIMES + 1):
        at = time * len(record) // (_TIMES + 1)
        pushed = record.input.copy()
        pushed[at] += size
        moved = innovations(packed, fit.noise, replace(whole, input=pushed)).innovation - undisturbed
        found.append(moved[at : at + longest, : len(used)] / size)
    weight = np.linalg.inv(np.linalg.cholesky(covariance(packed, record, innovation))).T
    answer = np.median(found, axis=0) @ weight
    large = np.max(np.abs(answer), axis=1)
    last = int(np.flatnonzero(large >= _ENDS * np.max(large))[-1])
    return np.asarray(answer[: last + 1], dtype=np.float64)


def _convolved(values: FloatArray, answer: FloatArray) -> FloatArray:
    """The observer's answer (n, channels) to a torque of values (n,)."""
    return np.column_stack([fftconvolve(values, one)[: len(values)] for one in answer.T])


def _quantities(fit: Fit, record: Record, states: FloatArray) -> dict[str, FloatArray]:
    """What a torque at the motor may be in proportion to (n,), by name: the input and what the observer
    predicts of the motion."""
    motor, velocity, parameters = states[:, 0], states[:, 2], fit.model.parameters
    torque = pack(fit.model).torque_constant * record.input + states[:, -2]
    torque = torque - parameters["motor_damping"] * velocity
    if not fit.model.rigid:
        torque = torque - parameters["stiffness"] * (motor - states[:, 1])
    found = {
        INPUT: record.input,
        ACCELERATION: torque / parameters["motor_inertia"],
        "a constant": np.ones(len(record)),
        "direction of motor velocity": np.sign(velocity),
        "motor angle": motor - np.mean(motor),
        "motor velocity": velocity,
        "squared motor velocity": velocity * np.abs(velocity),
    }
    if not fit.model.rigid:
        found |= {
            "deflection": motor - states[:, 1],
            "rate of deflection": velocity - states[:, 3],
            "arm velocity": states[:, 3],
        }
    return found

