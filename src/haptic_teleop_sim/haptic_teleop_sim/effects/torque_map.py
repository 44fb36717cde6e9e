"""A measured torque over one or two quantities: the model of physics that has no name.

Cubic Hermite pieces between the knots with the slopes of Fritsch and Carlson (1980), which do not overshoot;
held at its end values beyond the outermost knots.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from haptic_teleop_control.compiled import njit
from haptic_teleop_control.errors import ModelError

from .entry import EffectEntry

FloatArray = NDArray[np.float64]

#: What a map may depend on; the place in this tuple is its code in compiled code. At the joint angle and
#: velocity are those of the deflection. ``other_*``: the arm of the robot's other stage.
QUANTITIES = (
    "angle",
    "velocity",
    "deflection",
    "deflection_rate",
    "input",
    "other_angle",
    "other_velocity",
)
_KEYS = ("variable", "knots", "torque", "torque_std")


@dataclass(frozen=True)
class TorqueMap:
    """``variables``: one or two of QUANTITIES; ``knots``: ascending values of each, SI units; ``torque``: N·m
    at the knots, row by row (the last variable fastest); ``torque_std``: its standard errors, or ()."""

    variables: tuple[str, ...]
    knots: tuple[tuple[float, ...], ...]
    torque: tuple[float, ...]
    torque_std: tuple[float, ...] = ()

    @property
    def shape(self) -> tuple[int, ...]:
        """How many knots each variable has."""
        return tuple(len(k) for k in self.knots)

    def table(self) -> FloatArray:
        """Torque at the knots, N·m, of shape `shape`."""
        return np.array(self.torque).reshape(self.shape)

    def band(self) -> FloatArray | None:
        """Standard errors at the knots, N·m, of shape `shape`; None where there are none."""
        return np.array(self.torque_std).reshape(self.shape) if self.torque_std else None

    def packed(self) -> list[float]:
        """What compiled code reads: number and codes of the variables, numbers of knots, knots, and at the
        knots the torque and its slopes (along the first, the second, both)."""
        table, codes = self.table(), [float(QUANTITIES.index(v)) for v in self.variables]
        if len(self.knots) == 1:
            parts = [table, _slopes(self.knots[0], table)]
            head = [1.0, codes[0], 0.0, float(len(table)), 0.0]
        else:
            first = _slopes(self.knots[0], table)
            second = _slopes(self.knots[1], table.T).T
            parts = [table, first, second, _slopes(self.knots[1], first.T).T]
            head = [2.0, *codes, *(float(n) for n in table.shape)]
        return [*head, *(q for k in self.knots for q in k), *np.concatenate([p.ravel() for p in parts])]

    def steepest(self, names: tuple[str, ...]) -> float:
        """Largest slope between knots along the variables of these names, N·m per unit; 0 without them."""
        table, most = self.table(), 0.0
        for axis, name in enumerate(self.variables):
            if name in names:
                steps = np.diff(np.array(self.knots[axis]))
                rises = np.moveaxis(np.diff(table, axis=axis), axis, -1)
                # Between knots a cubic without overshoot is at most half as steep again.
                most = max(most, 1.5 * float(np.max(np.abs(rises / steps))))
        return most

    def at(self, *values: FloatArray) -> FloatArray:
        """Torque, N·m, at arrays of the variables of one shape."""
        p = np.array(self.packed())
        first, *more = (np.asarray(v, dtype=float) for v in values)
        flat = map_series(first.ravel(), (more[0] if more else first).ravel(), p)
        return flat.reshape(first.shape)

    def to_mapping(self) -> dict[str, Any]:
        """The parameters as the model file has them."""
        one = len(self.variables) == 1
        found: dict[str, Any] = {
            "variable": self.variables[0] if one else list(self.variables),
            "knots": list(self.knots[0]) if one else [list(k) for k in self.knots],
            "torque": self.table().tolist(),
        }
        band = self.band()
        return found if band is None else {**found, "torque_std": band.tolist()}


def torque_map(parameters: Mapping[str, Any], source: str = "the model") -> TorqueMap:
    """A map from the parameters of a model file; ModelError names what is wrong and the remedy."""
    for key in parameters:
        if key not in _KEYS:
            raise ModelError(f"{source}: unknown parameter of torque_map: {key!r}; known: {', '.join(_KEYS)}")
    for key in _KEYS[:3]:
        if key not in parameters:
            raise ModelError(f"{source}: torque_map.{key} is missing; it needs variable, knots and torque")
    named = parameters["variable"]
    variables = tuple(named) if isinstance(named, list | tuple) else (named,)
    if not 1 <= len(variables) <= 2 or len(set(map(str, variables))) != len(variables):
        raise ModelError(
            f"{source}: torque_map.variable is {named!r}; give one quantity, or two different ones"
        )
    for variable in variables:
        if variable not in QUANTITIES:
            raise ModelError(
                f"{source}: torque_map.variable names {variable!r}; give one or two of "
                + ", ".join(QUANTITIES)
            )
    given = parameters["knots"]
    if len(variables) == 2 and not (isinstance(given, list | tuple) and len(given) == 2):
        raise ModelError(f"{source}: torque_map.knots must be two lists, one for each variable")
    lists = [given] if len(variables) == 1 else list(given)
    knots = tuple(_numbers(k, "knots", source) for k in lists)
    for own in knots:
        if own.ndim != 1 or len(own) < 2 or not np.all(np.diff(own) > 0.0):
            raise ModelError(f"{source}: torque_map.knots must ascend, two or more for each variable")
    shape = tuple(len(k) for k in knots)
    torque = _table(parameters["torque"], "torque", shape, source)
    given_std = parameters.get("torque_std")
    std = None if given_std is None else _table(given_std, "torque_std", shape, source)
    if std is not None and np.any(std < 0.0):
        raise ModelError(
            f"{source}: torque_map.torque_std has a number below zero; give standard errors in N·m"
        )
    return TorqueMap(
        tuple(map(str, variables)),
        tuple(tuple(k.tolist()) for k in knots),
        tuple(torque.ravel().tolist()),
        () if std is None else tuple(std.ravel().tolist()),
    )


def _numbers(values: object, name: str, source: str) -> FloatArray:
    try:
        found = np.array(values)
    except ValueError:  # rows of different lengths
        found = np.array(["?"])
    if found.dtype.kind not in "fi" or not np.all(np.isfinite(found)):
        raise ModelError(f"{source}: torque_map.{name} must be lists of finite numbers, rows of one length")
    return found.astype(np.float64)


def _table(values: object, name: str, shape: tuple[int, ...], source: str) -> FloatArray:
    found = _numbers(values, name, source)
    if found.shape != shape:
        raise ModelError(
            f"{source}: torque_map.{name} has {' x '.join(map(str, found.shape))} numbers and the knots ask "
            f"for {' x '.join(map(str, shape))}; give one torque for each knot"
        )
    return found


def _slopes(knots: tuple[float, ...], values: FloatArray) -> FloatArray:
    """Slopes at the knots along the first axis."""
    curve = scipy.interpolate.PchipInterpolator(np.array(knots), values, axis=0)
    return np.asarray(curve(np.array(knots), 1), dtype=float)


@njit(cache=True, error_model="numpy", nogil=True)
def map_value(position, velocity, deflection, stiffness, time, exogenous, input, deflection_rate, state0,
              state1, direction, p, k):  # fmt: skip
    """Torque of the map at ``p[k:]`` (`TorqueMap.packed`), N·m."""
    both = p[k] > 1.5
    at = k + 5
    a0, a1, a2, a3, row = 0.0, 0.0, 0.0, 0.0, 0
    b0, b1, b2, b3, column = 1.0, 0.0, 0.0, 0.0, 0
    for axis in range(2 if both else 1):
        code = int(p[k + 1 + axis])
        if code < 2:
            x = position if code == 0 else velocity
        elif code < 4:
            x = deflection if code == 2 else deflection_rate
        else:
            x = input if code == 4 else exogenous
        n = int(p[k + 3 + axis])
        x = min(max(x, p[at]), p[at + n - 1])
        low, high = 0, n - 1
        while high - low > 1:
            middle = (low + high) // 2
            if p[at + middle] <= x:
                low = middle
            else:
                high = middle
        h = p[at + low + 1] - p[at + low]
        s = (x - p[at + low]) / h
        # Weights of the values and of the slopes at both ends.
        w0, w1 = (1.0 + 2.0 * s) * (1.0 - s) * (1.0 - s), s * s * (3.0 - 2.0 * s)
        w2, w3 = h * s * (1.0 - s) * (1.0 - s), h * s * s * (s - 1.0)
        if axis == 0:
            a0, a1, a2, a3, row = w0, w1, w2, w3, low
        else:
            b0, b1, b2, b3, column = w0, w1, w2, w3, low
        at += n
    n = int(p[k + 3])
    if not both:
        o = at + row
        return a0 * p[o] + a1 * p[o + 1] + a2 * p[o + n] + a3 * p[o + n + 1]
    m = int(p[k + 4])
    size = n * m
    total = 0.0
    for i in range(2):
        o = at + (row + i) * m + column
        value, slope = (a0, a2) if i == 0 else (a1, a3)
        total += value * (b0 * p[o] + b1 * p[o + 1] + b2 * p[o + 2 * size] + b3 * p[o + 2 * size + 1])
        o += size
        total += slope * (b0 * p[o] + b1 * p[o + 1] + b2 * p[o + 2 * size] + b3 * p[o + 2 * size + 1])
    return total


#: Width of the difference by which derivatives are taken, as a share of the span of the knots: the map is a
#: cubic between them, so that a central difference is exact to its square.
_NEAR = 1e-6


@njit(cache=True, error_model="numpy", nogil=True)
def map_value_derivatives(position, velocity, deflection, stiffness, time, exogenous, input, deflection_rate,
                          state0, state1, direction, p, k, g):  # fmt: skip
    """The same with its derivatives by what it depends on (`codegen.DERIVATIVE_ORDER`)."""
    for i in range(9):
        g[i] = 0.0
    at = k + 5
    for axis in range(int(p[k])):
        code = int(p[k + 1 + axis])
        n = int(p[k + 3 + axis])
        h = _NEAR * (p[at + n - 1] - p[at])
        at += n
        if code > 4:
            continue
        q, v = (h if code == 0 else 0.0), (h if code == 1 else 0.0)
        d, r, u = (h if code == 2 else 0.0), (h if code == 3 else 0.0), (h if code == 4 else 0.0)
        above = map_value(position + q, velocity + v, deflection + d, stiffness, time, exogenous, input + u,
                          deflection_rate + r, state0, state1, direction, p, k)  # fmt: skip
        below = map_value(position - q, velocity - v, deflection - d, stiffness, time, exogenous, input - u,
                          deflection_rate - r, state0, state1, direction, p, k)  # fmt: skip
        place = 0 if code == 0 else (1 if code == 1 else (2 if code == 2 else (8 if code == 3 else 7)))
        g[place] = (above - below) / (2.0 * h)
    return map_value(position, velocity, deflection, stiffness, time, exogenous, input, deflection_rate,
                     state0, state1, direction, p, k)  # fmt: skip


@njit(cache=True, error_model="numpy", nogil=True)
def map_series(first: FloatArray, second: FloatArray, p: FloatArray) -> FloatArray:
    """The map along values (n,) of its variables, whatever they are called."""
    q = p.copy()
    q[1], q[2] = 0.0, 1.0
    found = np.empty(len(first))
    for i in range(len(first)):
        found[i] = map_value(first[i], second[i], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, q, 0)
    return found


TORQUE_MAP = EffectEntry(
    name="torque_map",
    kind="torque",
    where=("motor", "arm", "joint"),
    parameters=(),
    sentence="a measured curve or surface of torque stands for physics without a name",
    compiled=(map_value, map_value_derivatives),
    tabulated=True,
    condition="what its map depends on",
    needs="a diagnosis that ended without a name, or a curve measured by itself",
)
ENTRIES = (TORQUE_MAP,)
