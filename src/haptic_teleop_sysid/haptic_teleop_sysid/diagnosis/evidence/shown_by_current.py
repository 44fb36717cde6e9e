"""What the measured current says of the actuator, before anything is asked of the motion.

Where both the command and the measured current are recorded, their difference shows a delay, a lag, a limit
or a dead band by itself, if the sense sits behind it; and only there does it show that the measured current
is stamped wrong.  Each is fitted by least squares on the recorded currents (offset and scale of the sense are
free).  Whether the torque follows suit is for the motion to say: a late stamp moves nothing, a late torque
does.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.recordings.dataset import DataSet

from ..hypotheses.enough import gains_enough
from .recorded_currents import SHOWN, UNSEEN, Currents, nats_of

FloatArray = NDArray[np.float64]

#: Error of a value that is found, relative: its standard error is far larger.
_NEAR = 1e-6
#: Steps of the sense that a dead band has at least: one that is cut off towards zero has half a step.
_STEPS = 2.0
#: Starts: times in samples (a loop's command is so lively that a delay shows only within one of its own),
#: limits and dead bands relative to the largest and the rms command.
_TIMES = (0.02, 0.1, 0.3, 0.6, *(float(n) for n in range(1, UNSEEN + 1)))
_LIMITS = (0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99)
_WIDTHS = (0.005, 0.02, 0.05, 0.1, 0.2, 0.4)
#: Most starts of an effect that are asked of all samples, the best on a lively stretch of each recording.
_MOST_STARTS = 8


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
    sides = [Currents.of(d) for d in estimation], [Currents.of(d) for d in validation]
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
    estimation: Sequence[Currents],
    validation: Sequence[Currents],
) -> Shown | None:
    location = model.location("actuator")

    def effect(value: float) -> Effect:
        return Effect(name, location, {parameter: value})

    def nats(value: float, data: Sequence[Currents]) -> float:
        return sum(nats_of(model, effect(value), d) for d in data)

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
    starts: Sequence[float], parts: Sequence[Currents], nats: Callable[[float, Sequence[Currents]], float]
) -> NDArray[np.intp]:
    """Places of the _MOST_STARTS starts that are best on ``parts``; of all where they are no more."""
    if len(starts) <= _MOST_STARTS:
        return np.arange(len(starts))
    return np.argsort([-nats(v, parts) for v in starts], kind="stable")[:_MOST_STARTS]


def _none(name: str, parameter: str, model: Model, currents: Sequence[Currents]) -> float:
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
