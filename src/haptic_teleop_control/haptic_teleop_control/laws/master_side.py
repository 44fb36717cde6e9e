"""The master's side of scenario 1 (thesis 4.3.1): from the device's position to a desired torque and a felt
torque.

    Td     = torque_gain (phi - neutral)
    torque = -spring (phi - neutral) - feedback_gain LP(Te)

The virtual spring keeps the neutral position and is felt; the desired torque is not. The two gains are
independent: the thesis' 10 N·m/rad would be far more than the device can give. Te is the torque of the robot
on its environment, so the operator feels its opposite.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from haptic_teleop_control.compiled import njit
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.filters import low_pass_coefficients
from haptic_teleop_control.laws.contract import Array, LawResult
from haptic_teleop_control.laws.gain_ramp import GainRamp
from haptic_teleop_control.parameters import Parameter
from haptic_teleop_control.quantities import (
    check_quantities,
    parameters_of_each,
    quantity,
    settings_of_each,
)
from haptic_teleop_control.robots import OMNI_CONTINUOUS_TORQUE, OMNI_PEAK_TORQUE

_OK = int(LawResult.OK)
_SATURATED = int(LawResult.SATURATED)
_REFUSED_INPUT = int(LawResult.REFUSED_INPUT)
_DISABLED = int(LawResult.DISABLED)


@dataclass(frozen=True)
class MasterSettings:
    """One axis of the master. Raises ConfigurationError naming the field for a value outside its range."""

    torque_gain: float = quantity(
        10.0, "N·m/rad", "desired torque per angle from the neutral position", minimum=0.0
    )
    spring: float = quantity(0.3, "N·m/rad", "virtual spring felt by the hand", minimum=0.0)
    neutral: float = quantity(0.0, "rad", "neutral position")
    feedback_gain: float = quantity(
        0.0, "", "felt share of the torque on the environment; 0 switches it off", minimum=0.0
    )
    feedback_cutoff_hz: float = quantity(
        math.inf, "Hz", "low-pass of the feedback; .inf for none", above=0.0, infinite=True
    )
    torque_limit: float = quantity(
        OMNI_CONTINUOUS_TORQUE,
        "N·m",
        "largest torque asked of the device",
        minimum=0.0,
        maximum=OMNI_PEAK_TORQUE,
    )
    desired_torque_limit: float = quantity(
        math.inf, "N·m", "largest desired torque; .inf for none", above=0.0, infinite=True
    )

    def __post_init__(self) -> None:
        check_quantities(self)


class MasterSide:
    """The master's side for n axes, stepped every dt.

    enabled: (n,) bool, writable; a disabled axis gives zero for both torques.
    results: (n,), a LawResult for each axis: SATURATED when one of the two limits held.
    state: (n, 2), filtered feedback torque and the last one received, N·m.
    """

    def __init__(self, settings: Sequence[MasterSettings], dt: float) -> None:
        if not settings:
            raise ConfigurationError("master side: no axis; give the settings of at least one.")
        if not (math.isfinite(dt) and dt > 0.0):
            raise ConfigurationError(f"master side: dt is {dt} s; choose a finite time above 0.")
        self.dt = float(dt)
        self.axes = len(settings)
        self.enabled = np.ones(self.axes, dtype=np.bool_)
        self.results: NDArray[np.int64] = np.zeros(self.axes, dtype=np.int64)
        self._state = np.zeros((self.axes, 2))
        self._inputs = np.zeros((2, self.axes))
        self._settings = tuple(settings)
        self._ramp = GainRamp(_matrix(self._settings, self.dt), self.dt)
        self._matrix = self._ramp.value
        master_side_step(self._inputs, self._matrix, self.enabled, self._state.copy(), self.results)

    def step(self, position: ArrayLike, feedback_torque: ArrayLike) -> tuple[Array, Array]:
        """(desired_torque, device_torque), (n,) each, N·m, from position (n,), rad, and Te (n,), N·m.

        An axis with an input that is not finite gives zero for both and keeps its filter.
        Raises ValueError when an argument does not have n values.
        """
        if self._ramp.moving:
            self._ramp.step()
        self._inputs[0] = position
        self._inputs[1] = feedback_torque
        out = master_side_step(self._inputs, self._matrix, self.enabled, self._state, self.results)
        return out[0], out[1]

    def reset(self, axis: int | None = None) -> None:
        """Empty the feedback filter of one axis, or of all."""
        if axis is None:
            self._state[:] = 0.0
            self._ramp.jump()
        else:
            self._state[axis] = 0.0

    @property
    def state(self) -> Array:
        return self._state.copy()

    @state.setter
    def state(self, value: ArrayLike) -> None:
        self._state[:] = value

    @property
    def settings(self) -> tuple[MasterSettings, ...]:
        """Settings of each axis; assigned ones hold from the next step on."""
        return self._settings

    @settings.setter
    def settings(self, settings: Sequence[MasterSettings]) -> None:
        self._ramp.jump(self._checked(settings))

    def _checked(self, settings: Sequence[MasterSettings]) -> Array:
        if len(settings) != self.axes:
            raise ConfigurationError(f"master side: settings of {len(settings)} axes; give {self.axes}.")
        self._settings = tuple(settings)
        return _matrix(self._settings, self.dt)

    @classmethod
    def parameters(cls, prefixes: Sequence[str]) -> list[Parameter]:
        """Parameters of a node, `<prefix>.torque_gain` and so on, one group for each of `prefixes`."""
        return parameters_of_each(_nominal(prefixes))

    @classmethod
    def from_parameters(cls, values: Mapping[str, Any], prefixes: Sequence[str], dt: float) -> MasterSide:
        """The master's side from such parameters. Raises ConfigurationError naming the parameter."""
        return cls(settings_of_each(_nominal(prefixes), values), dt)

    def update(self, values: Mapping[str, Any], prefixes: Sequence[str]) -> None:
        """Take changed parameters while running: the torques go over to the new settings within
        `gain_ramp.RAMP_TIME`. Raises ConfigurationError, and then has changed nothing."""
        self._ramp.to(self._checked(settings_of_each(_nominal(prefixes), values)))


def _nominal(prefixes: Sequence[str]) -> list[tuple[str, MasterSettings]]:
    """(prefix of the parameters, nominal settings) of each axis."""
    return [(f"{prefix}.", MasterSettings()) for prefix in prefixes]


def _matrix(settings: Sequence[MasterSettings], dt: float) -> Array:
    """(n, 9): torque gain, spring, neutral, feedback gain, both limits, three coefficients of the
    low-pass."""
    rows = [
        (
            s.torque_gain,
            s.spring,
            s.neutral,
            s.feedback_gain,
            s.desired_torque_limit,
            s.torque_limit,
            *low_pass_coefficients(dt, s.feedback_cutoff_hz),
        )
        for s in settings
    ]
    return np.array(rows, dtype=np.float64)


@njit(cache=True)
def master_side_step(inputs, settings, enabled, state, results):  # type: ignore[no-untyped-def]
    """One step for n axes; (2, n), rows desired torque and device torque.

    inputs: (2, n), rows position and Te. settings: (n, 9) from `_matrix`. enabled: (n,) bool. Changed in
    place: state (n, 2), results (n,) int64.
    """
    n = inputs.shape[1]
    out = np.zeros((2, n))
    for i in range(n):
        angle = inputs[0, i] - settings[i, 2]
        felt = settings[i, 6] * state[i, 0] + settings[i, 7] * state[i, 1] + settings[i, 8] * inputs[1, i]
        desired = settings[i, 0] * angle
        device = -settings[i, 1] * angle - settings[i, 3] * felt
        if not (math.isfinite(desired) and math.isfinite(device) and math.isfinite(inputs[1, i])):
            results[i] = _REFUSED_INPUT
            continue
        state[i, 0] = felt
        state[i, 1] = inputs[1, i]
        if not enabled[i]:
            results[i] = _DISABLED
            continue
        out[0, i] = min(max(desired, -settings[i, 4]), settings[i, 4])
        out[1, i] = min(max(device, -settings[i, 5]), settings[i, 5])
        limited = out[0, i] != desired or out[1, i] != device
        results[i] = _SATURATED if limited else _OK
    return out
