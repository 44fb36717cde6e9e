"""What a torque missing at the motor is in proportion to, by a factor that may change with time.

What an amplifier loses is a share of its input, whatever the joint does: a limit that folds back, a supply
that sags, commands that are lost for a moment, a motor that is weaker at some angles. What a bearing or a
load takes is not. For each quantity x it is asked how much likelier the recordings are with a torque
x(t) f(t) at the motor whose factor f is a random process (see `changing_factor`): each quantity has the same
two numbers to be fitted, so that their gains can be compared. What a constant factor explains is taken out
before: the structure or a name has that.

In a closed loop the input answers to whatever is missing, a hand that pushes, too, but later and by another
factor at each frequency; the observer is surprised by the push before, and by what moves with it.

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
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import (
    FAILURES,
    after_settling,
    channels,
    innovation_covariance,
    innovations,
    seen,
)
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.whitening import whiten, whitening_weight

from ..inputs.scales import bridged
from ..policy import CANNOT_TELL
from .changing_factor import Surprise, best, cell_length, log_evidence

FloatArray = NDArray[np.float64]

INPUT, ACCELERATION = "input", "acceleration"
#: Nats, and share of its gain, by which the acceleration must gain more than the input to be what a torque is
#: in proportion to; and nats that the input must gain.
CLEARLY, CLEARLY_SHARE = 12.0, 0.05
#: Share of its gain (and CANNOT_TELL) by which the input must gain more than any motion. By hand, on four
#: seeds of the benchmark and four draws by other authors: of 22 faults of an actuator that are told by it two
#: gain less than 12 nats more; of motor or arm one is told so, on a rigid joint.
MORE = 0.02
#: Size of the torque by which the observer's answer is found, of the rms input, and times at which it is.
_PUSH, _TIMES = 1e-3, 5
#: Longest answer, s, and its end as a share of its largest value.
_LONGEST, _ENDS = 1.0, 1e-3
#: Share of the largest singular value from which columns count as combinations of others.
_SAME = 1e-8


def in_proportion(fits: Sequence[tuple[Fit, Sequence[Record]]], free: tuple[str, ...]) -> dict[str, float]:
    """The nats by which a factor that changes with time makes all recordings together likelier, for each
    quantity, the largest first; {} where arithmetic fails. ``fits``: each with its records; ``free``: the
    parameters that make up for what they can."""
    gains: dict[str, list[FloatArray]] = {}
    try:
        asked = [
            _asked(fit, record, free) for fit, records in fits for record in records if np.any(record.input)
        ]
        cell = cell_length([surprise.dt * len(surprise.read) for surprise, _ in asked] or [0.0])
        for name in asked[0][1] if asked else ():
            # One factor has one size on all recordings: in units of what the input is to the quantity.
            size = _rms([values[name] for _, values in asked])
            unit = _rms([values[INPUT] for _, values in asked]) / max(size, 1e-300)
            gains[name] = [log_evidence(surprise, unit * values[name], cell) for surprise, values in asked]
    except FAILURES:
        return {}
    return dict(sorted(((name, best(each)) for name, each in gains.items()), key=lambda one: -one[1]))


def _rms(values: Sequence[FloatArray]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(values) ** 2)))


def with_the_input(gains: dict[str, float], rigid: bool = False) -> bool:
    """Whether what is missing is in proportion to the input, and clearly less so to any motion; on a
    ``rigid`` joint, whose acceleration is nearly the input, to that not clearly more."""
    motion = [gain for name, gain in gains.items() if name != INPUT and not (rigid and name == ACCELERATION)]
    if not motion:
        return False
    own = gains[INPUT]
    if rigid and _clearly_more(gains[ACCELERATION], own):
        return False
    return own > CLEARLY and own - max(motion) > max(CANNOT_TELL, MORE * own)


def _clearly_more(gain: float, other: float) -> bool:
    return gain - other > max(CLEARLY, CLEARLY_SHARE * gain)


def _asked(
    fit: Fit, record: Record, free: tuple[str, ...]
) -> tuple[Surprise, dict[str, FloatArray]]:
    """The innovations on one recording, beside ``free`` parameters and constant factors, and the quantities
    (n,) by name."""
    packed = pack(fit.model)
    run = innovations(packed, fit.noise, record, free)
    count = len(channels(packed, record))
    errors, slopes = whiten(packed, record, run.innovation, run.d_innovation)
    answer = _answer(packed, fit, record, run.innovation)
    every = seen(packed, record)[:, :count]
    read = after_settling(record, every)
    quantities = _quantities(fit, record, run.states)
    constant = [
        (after_settling(record, _convolved(values, answer)) * read).reshape(-1)
        for values in quantities.values()
    ]
    steady = np.column_stack([slopes, *constant])
    length = np.sqrt(np.sum(steady**2, axis=0))
    axes, sizes, _ = np.linalg.svd(steady[:, length > 0.0] / length[length > 0.0], full_matrices=False)
    allowed = axes[:, sizes > _SAME * sizes[0]]
    return Surprise(errors, allowed, every, answer, record.dt), quantities


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
    weight = whitening_weight(innovation_covariance(packed, record, innovation))
    answer = np.median(found, axis=0) @ weight
    if not np.all(np.isfinite(answer)):
        raise ArithmeticError("the observer's answer is not finite")
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

