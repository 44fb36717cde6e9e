"""What the measured current says of the actuator, before anything is asked of the motion.

Where both the command and the measured current are recorded, their difference shows a delay, a lag, a limit
or a dead band by itself, if the sense sits behind it; and only there does it show that the measured current
is stamped wrong.  Each is fitted by least squares on the recorded currents (offset and scale of the sense are
free).  Whether the torque follows suit is for the motion to say: a late stamp moves nothing, a late torque
does.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from haptic_teleop_control.compiled import njit
from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sim.kernel import acting_torque, pack
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.recordings.dataset import DataSet

from ..hypotheses.enough import gains_enough

FloatArray = NDArray[np.float64]

#: Effects that a current behind them shows, and their parameter.
SHOWN = {e.name: p.name for e in EFFECTS.values() for p in e.parameters if p.in_current}
#: Standard deviation of the sense that is granted at least, relative to the rms command.
_EXACT = 1e-4
#: Samples that speak most for an effect and do not count.
_SPIKES = 3
#: Differences of readings, relative to the largest, that are rounding.
_ROUNDING = 1e-9
#: Error of a value that is found, relative: its standard error is far larger.
_NEAR = 1e-6
#: Steps of the sense that a dead band has at least: one that is cut off towards zero has half a step.
_STEPS = 2.0
#: Samples at the start that may still answer what was commanded before the recording.
_UNSEEN = 64
#: Starts: times in samples (a loop's command is so lively that a delay shows only within one of its own),
#: limits and dead bands relative to the largest and the rms command.
_TIMES = (0.02, 0.1, 0.3, 0.6, *(float(n) for n in range(1, _UNSEEN + 1)))
_LIMITS = (0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99)
_WIDTHS = (0.005, 0.02, 0.05, 0.1, 0.2, 0.4)
#: Most starts of an effect that are asked of all samples, the best on a lively stretch of each recording; and
#: how long that is, in samples.
_MOST_STARTS, _LIVELIEST = 8, 8192


@dataclass(frozen=True)
class Shown:
    """An effect as the currents show it.

    ``gain``, ``held_out``: nats on the estimation and the validation recordings; ``std``: of its parameter;
    ``value_nats``: nats on the estimation recordings at another value of it.
    """

    effect: Effect
    std: float
    gain: float
    held_out: float
    value_nats: Callable[[float], float]


def shown_by_current(
    model: Model, estimation: Sequence[DataSet], validation: Sequence[DataSet]
) -> list[Shown]:
    """Every effect of SHOWN as the currents have it, best first; empty where they say nothing, or where not
    every recording has both."""
    data = [*estimation, *validation]
    if any(d.commanded_input is None or d.input_source != "measured effort" for d in data):
        return []
    found = []
    sides = [_Currents.of(d) for d in estimation], [_Currents.of(d) for d in validation]
    for name, parameter in SHOWN.items():
        best = _fitted(model, name, parameter, *sides)
        if best is not None:
            found.append(best)
    found.sort(key=lambda s: -(s.gain + s.held_out))
    return found if any(gains_enough(s.gain, s.held_out) for s in found) else []


def _fitted(
    model: Model,
    name: str,
    parameter: str,
    estimation: Sequence[_Currents],
    validation: Sequence[_Currents],
) -> Shown | None:
    location = model.location("actuator")

    def effect(value: float) -> Effect:
        return Effect(name, location, {parameter: value})

    def nats(value: float, data: Sequence[_Currents]) -> float:
        return sum(_nats(model, effect(value), d) for d in data)

    starts = _starts(name, model, [c.data for c in estimation])
    values = np.full(len(starts), -np.inf)
    for place in _promising(starts, [c.liveliest for c in estimation], nats):
        values[place] = nats(starts[place], estimation)
    best = int(np.argmax(values))
    # Beyond the smallest start lie smaller effects, down to none.
    ends = sorted((*starts, _none(name, parameter, model, estimation)))
    at = ends.index(starts[best])
    edges = ends[max(at - 1, 0)], ends[min(at + 1, len(ends) - 1)]
    if edges[0] == edges[1]:
        return None
    ended: Any = scipy.optimize.minimize_scalar(
        lambda v: -nats(float(v), estimation),
        bounds=edges,
        method="bounded",
        options={"xatol": _NEAR * max(map(abs, edges))},
    )
    value, top = float(ended.x), -float(ended.fun)
    if values[best] > top:
        value, top = starts[best], values[best]
    steps = _STEPS * max(c.step for c in estimation) * model.parameters["torque_constant"]
    if EFFECTS[name].parameter(parameter).in_current == "rms" and value < steps:
        return None
    step = 0.02 * abs(value) if value else 1e-6
    bend = (nats(value + step, estimation) + nats(value - step, estimation) - 2.0 * top) / step**2
    std = float(np.sqrt(-1.0 / bend)) if bend < 0.0 else abs(value)
    return Shown(effect(value), std, top, nats(value, validation), lambda v: nats(v, estimation))


def _promising(
    starts: Sequence[float], parts: Sequence[_Currents], nats: Callable[[float, Sequence[_Currents]], float]
) -> NDArray[np.intp]:
    """Places of the _MOST_STARTS starts that are best on ``parts``; of all where they are no more."""
    if len(starts) <= _MOST_STARTS:
        return np.arange(len(starts))
    return np.argsort([-nats(v, parts) for v in starts], kind="stable")[:_MOST_STARTS]


def _none(name: str, parameter: str, model: Model, currents: Sequence[_Currents]) -> float:
    """The parameter of an effect that shows nothing: zero, or a limit at the largest command."""
    if EFFECTS[name].parameter(parameter).in_current != "peak":
        return 0.0
    return model.parameters["torque_constant"] * max(float(np.max(np.abs(c.command))) for c in currents)


def _starts(name: str, model: Model, data: Sequence[DataSet]) -> list[float]:
    command = (
        np.concatenate([np.asarray(d.commanded_input) for d in data]) * model.parameters["torque_constant"]
    )
    dt = data[0].dt
    parameter = EFFECTS[name].parameter(SHOWN[name])
    if parameter.in_current == "peak":
        return [share * float(np.max(np.abs(command))) for share in _LIMITS]
    if parameter.in_current == "rms":
        return [share * float(np.std(command)) for share in _WIDTHS]
    # The bend at the best value is measured a little beyond it.
    longest = parameter.maximum / 1.05
    times = [t * dt for t in _TIMES if t * dt <= longest]
    return [-t for t in reversed(times)] + times if parameter.minimum < 0.0 else times


@dataclass(frozen=True)
class _Currents:
    """Both currents of a recording: ``command`` (n,), zero where it is not known; ``good`` (n,): the samples
    that are judged; ``sent``, ``sensed``: command and measured current there; ``floor``: mean square, A^2,
    that is granted the sense; ``step``: least difference of its readings, A, but for rounding."""

    data: DataSet
    command: FloatArray
    good: NDArray[np.bool_]
    sent: FloatArray
    sensed: FloatArray
    floor: float
    step: float

    @classmethod
    def of(cls, data: DataSet) -> _Currents:
        command, sensed = np.asarray(data.commanded_input, dtype=float), np.asarray(data.input, dtype=float)
        good = np.isfinite(command) & np.isfinite(sensed)
        command = np.where(np.isfinite(command), command, 0.0)
        # Not judged, but commanded all the same: the first judged samples answer them.
        good[: min(_UNSEEN, len(good) // 10)] = False
        floor = (_EXACT * float(np.std(command[good]))) ** 2
        apart = np.diff(np.unique(sensed[good]))
        apart = apart[apart > _ROUNDING * np.max(np.abs(sensed[good]))]
        return cls(data, command, good, command[good], sensed[good], floor, float(min(apart, default=0.0)))

    @cached_property
    def liveliest(self) -> _Currents:
        """The stretch of _LIVELIEST samples in which the command changes most; itself where it is shorter, or
        half of that is not judged."""
        n = len(self.command)
        if n <= _LIVELIEST:
            return self
        changes = np.cumsum(np.append(0.0, np.diff(self.command) ** 2))
        begins = np.arange(0, n - _LIVELIEST + 1, _LIVELIEST // 4)
        first = int(begins[np.argmax(changes[begins + _LIVELIEST - 1] - changes[begins])])
        stretch = slice(first, first + _LIVELIEST)
        command, good = self.command[stretch], self.good[stretch].copy()
        good[:_UNSEEN] = False
        if np.mean(good) < 0.5:
            return self
        sensed = np.zeros(n)
        sensed[self.good] = self.sensed
        return replace(self, command=command, good=good, sent=command[good], sensed=sensed[stretch][good])


def _nats(model: Model, effect: Effect, currents: _Currents) -> float:
    """Nats by which the measured current follows the effect's better than the command."""
    command, data = currents.command, currents.data
    if effect.entry.kind == "skew":
        at = np.arange(len(command)) - effect.parameters[SHOWN[effect.effect]] / data.dt
        expected = np.interp(at, np.arange(len(command)), command)
    else:
        packed = pack(model.with_effects(effect))
        expected = acting_torque(packed, command, data.dt, data.start) / packed.torque_constant
    before, after = _errors(currents.sent, expected[currents.good], currents.sensed, _SPIKES)
    floor = currents.floor
    return 0.5 * len(currents.sent) * float(np.log((before + floor) / (after + floor)))


@njit(cache=True, nogil=True, error_model="numpy")
def _errors(
    command: FloatArray, expected: FloatArray, sensed: FloatArray, spikes: int
) -> tuple[float, float]:
    """Mean squares, A^2, of what is left of the measured current (n,) about offset and scale times the
    command and about those times what is expected of it.

    The samples that speak most for the latter do not count: what speaks for an effect at a few alone is a
    spike, or the command that ended the experiment."""
    n = len(sensed)
    a, b = np.empty(n), np.empty((2, n))
    means = sensed.mean(), command.mean(), expected.mean()
    for i in range(n):  # one by one: see `compiled.py`
        a[i], b[0, i], b[1, i] = sensed[i] - means[0], command[i] - means[1], expected[i] - means[2]
    slopes = np.zeros(2)
    for k in range(2):
        power = b[k] @ b[k]
        slopes[k] = (b[k] @ a) / power if power > 0.0 else 0.0
    # Largest differences of the squares, in rising order, and where they are.
    most, where = np.full(spikes, -np.inf), np.zeros(spikes, dtype=np.int64)
    for i in range(n):
        gain = (a[i] - slopes[0] * b[0, i]) ** 2 - (a[i] - slopes[1] * b[1, i]) ** 2
        if gain > most[0]:
            j = 0
            while j + 1 < spikes and gain > most[j + 1]:
                most[j], where[j] = most[j + 1], where[j + 1]
                j += 1
            most[j], where[j] = gain, i
    left = np.empty(2)
    for k in range(2):
        own, cross, both, mean_a, mean_b = a @ a, a @ b[k], b[k] @ b[k], 0.0, 0.0
        for j in range(spikes):
            x, y = a[where[j]], b[k, where[j]]
            own, cross, both, mean_a, mean_b = (
                own - x * x,
                cross - x * y,
                both - y * y,
                mean_a - x,
                mean_b - y,
            )
        count = n - spikes
        own, cross, both = own - mean_a**2 / count, cross - mean_a * mean_b / count, both - mean_b**2 / count
        left[k] = max(own - cross**2 / both, 0.0) / count if both > 0.0 else own / count
    return left[0], left[1]
