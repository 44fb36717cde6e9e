"""A measured torque as a model file states it: read, and refused with the remedy."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.errors import ModelError

from .torque_map import QUANTITIES, TorqueMap

FloatArray = NDArray[np.float64]
_KEYS = ("variable", "knots", "torque", "torque_std")


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
