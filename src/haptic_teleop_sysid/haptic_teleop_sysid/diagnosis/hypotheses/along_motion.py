"""Effects as torques (or encoder errors) along a motion that is known."""

from __future__ import annotations

import math
from copy import copy
from types import SimpleNamespace

import numpy as np
import scipy
from numpy.typing import NDArray

from haptic_teleop_control.compiled import njit
from haptic_teleop_sim.effects import EffectEntry, EffectParameter
from haptic_teleop_sim.effects.on_arrays import NUMERIC
from haptic_teleop_sysid.estimation.records import Record

FloatArray = NDArray[np.float64]

#: Places about an angle, rad, from which the slope of an inertia there is taken.
_ASIDE = (-1e-5, 0.0, 1e-5)


def columns(
    entry: EffectEntry, parameter: EffectParameter, value: float, variables: SimpleNamespace
) -> FloatArray:
    """Torques (N·m, or encoder errors, rad) (columns, n) by unit sizes of the effect along the motion, of
    which ``variables`` are those of `variables_along`."""
    zero = {p.name: 0.0 if p.default is None else p.default for p in entry.parameters}
    zero[parameter.name] = value
    travel = float(np.ptp(variables.position))
    zero |= {p.name: p.held * travel for p in entry.parameters if p.held}
    sizes = [p.name for p in entry.parameters if p.default is None and p.neutral == 0.0 and not p.steady]
    trials = [{**zero, name: 1.0} for name in sizes]
    for phase in (p.name for p in entry.parameters if p.turns == "phase"):
        trials += [{**zero, name: 1.0, phase: math.pi / 2} for name in sizes]
    variables = copy(variables)
    equation = entry.equation
    if equation is None:
        raise ValueError(f"{entry.name} has no equation that could be followed along a motion")
    found = []
    for numbers in trials:
        p = SimpleNamespace(**numbers)
        if entry.rates:
            _own_states(entry, variables, p)
        if entry.kind == "relative_inertia":
            torque = inertia_torque(entry, variables, p)
        else:
            torque = np.broadcast_to(np.asarray(equation(variables, p), dtype=float), len(variables.position))
        found.append(torque - variables.position if entry.kind == "output" else torque)
    return np.array(found)


def inertia_torque(entry: EffectEntry, variables: SimpleNamespace, p: SimpleNamespace) -> FloatArray:
    """Torque (n,) of an inertia f(q) along a motion, for one kg·m² of structure: -(f a + f' v² / 2)."""
    equation = entry.equation
    assert equation is not None
    at = [SimpleNamespace(**{**vars(variables), "position": variables.position + h}) for h in _ASIDE]
    before, value, after = (np.asarray(equation(one, p), dtype=float) for one in at)
    slope = (after - before) / (_ASIDE[2] - _ASIDE[0])
    return -(value * variables.acceleration + 0.5 * slope * variables.velocity**2)


def variables_along(record: Record, states: FloatArray, channel: int) -> SimpleNamespace:
    """The variables and helpers in which effects write their equations, as arrays (n,) along the motion of
    motor (0) or arm (1) that ``states`` (n, ...) of a recording are."""
    # Each in one piece of memory: functions of arrays that are not take several times as long.
    position, velocity = (np.ascontiguousarray(states[:, k]) for k in (channel, 2 + channel))
    return SimpleNamespace(
        dt=record.dt,
        position=position,
        velocity=velocity,
        acceleration=np.gradient(velocity, record.dt) if len(velocity) > 1 else 0.0 * velocity,
        deflection=states[:, 0] - states[:, 1],
        time=record.start + record.dt * np.arange(len(record)),
        exogenous=record.exogenous,
        direction=np.sign(velocity),
        state0=0.0,
        state1=0.0,
        **NUMERIC,
    )


def _own_states(entry: EffectEntry, variables: SimpleNamespace, p: SimpleNamespace) -> None:
    """Fill in the own states (at most two) of an effect whose rates are linear in them."""
    names = [f"state{i}" for i in range(len(entry.rates))]
    for name in names:
        setattr(variables, name, 0.0)
    drive = np.array([rate(variables, p) + 0.0 * variables.time for rate in entry.rates])
    matrix = np.empty((len(names), len(names)))
    for column, name in enumerate(names):
        setattr(variables, name, 1.0)
        moved = np.array([np.asarray(rate(variables, p) + 0.0 * variables.time)[0] for rate in entry.rates])
        matrix[:, column] = moved - drive[:, 0]
        setattr(variables, name, 0.0)
    n = len(names)
    whole = np.zeros((2 * n, 2 * n))
    whole[:n, :n], whole[:n, n:] = matrix, np.eye(n)
    step = np.asarray(scipy.linalg.expm(whole * variables.dt), dtype=np.float64)
    # Each rate's drive as it was in the middle of the step.
    drive = np.concatenate([0.5 * (drive[:, 1:] + drive[:, :-1]), drive[:, -1:]], axis=1)
    followed = _followed(np.ascontiguousarray(step[:n, :n]), np.ascontiguousarray(step[:n, n:] @ drive))
    for i, name in enumerate(names):
        setattr(variables, name, followed[i])


@njit(cache=True, error_model="numpy", nogil=True)
def _followed(transition: FloatArray, pushed: FloatArray) -> FloatArray:
    """States (n, samples) of x[k+1] = transition x[k] + pushed[:, k] from rest."""
    n, samples = pushed.shape
    states = np.zeros((n, samples))
    for k in range(samples - 1):
        for i in range(n):
            total = pushed[i, k]
            for j in range(n):
                total += transition[i, j] * states[j, k]
            states[i, k + 1] = total
    return states
