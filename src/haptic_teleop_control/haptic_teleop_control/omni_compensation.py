"""What the Omni needs when it lies horizontally (thesis 2.3.2): torques that take its own effects away.

    X   T = Kp e + Ki integral(e) - Kd phi',  e = level - phi     held level by PI, and damped
    Y   T = k (phi - rest)                                        against the internal spring
    Z   T = bias                                                  against its drift

Angles are about the neutral position (thesis 2.3.3); that position is given to the driver as the angles of
the calibration pose, and to the simulated device as the origin of its model. The torques come on top of the
command, on the robot and in simulation alike, while the device is commanded; they ramp in over `ramp_time`
and none exceeds `limit`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import astuple, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from haptic_teleop_control.compiled import njit
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.parameters import Parameter
from haptic_teleop_control.quantities import check_quantities, from_parameters, parameters_of, quantity
from haptic_teleop_control.robots import OMNI_AXES, OMNI_PEAK_TORQUE

Array = NDArray[np.float64]
PREFIX = "compensation."


@dataclass(frozen=True)
class CompensationSettings:
    """Everything is off by default. Raises ConfigurationError naming the field for a value outside its
    range."""

    kp: float = quantity(0.0, "N·m/rad", "gain that holds X level", name="level.kp", minimum=0.0)
    ki: float = quantity(0.0, "N·m/(rad·s)", "integral gain that holds X level", name="level.ki", minimum=0.0)
    kd: float = quantity(0.0, "N·m·s/rad", "damping of X", name="level.kd", minimum=0.0)
    level: float = quantity(0.0, "rad", "angle of X that is level", name="level.angle")
    spring: float = quantity(
        0.0,
        "N·m/rad",
        f"of Y's internal spring, to be taken away; nominal {OMNI_AXES['omni_y'].spring_stiffness:g}",
        minimum=0.0,
    )
    spring_rest: float = quantity(
        OMNI_AXES["omni_y"].spring_rest, "rad", "angle of Y at which that spring is relaxed"
    )
    bias: float = quantity(0.0, "N·m", "constant torque on Z against its drift")
    limit: float = quantity(
        0.25, "N·m", "largest compensating torque of an axis", minimum=0.0, maximum=OMNI_PEAK_TORQUE
    )
    ramp_time: float = quantity(0.5, "s", "from none to full compensation", minimum=0.0, maximum=10.0)

    def __post_init__(self) -> None:
        check_quantities(self)

    @property
    def active(self) -> bool:
        """Whether there is anything to do."""
        return self.limit > 0.0 and any((self.kp, self.ki, self.kd, self.spring, self.bias))


COMPENSATION: list[Parameter] = parameters_of(CompensationSettings(), PREFIX, runtime=False)
"""Parameters of the driver and of the simulated device."""


class OmniCompensation:
    """The three torques, sample by sample. state: (2,), integral of X as a torque, N·m, and s since start.

    settings, numbers: as given, and as the compiled step takes them.
    """

    def __init__(self, settings: CompensationSettings) -> None:
        self.settings = settings
        self.numbers = np.array(astuple(settings), dtype=np.float64)
        self.state = np.zeros(2)
        self.torque = np.zeros(3)
        self._inputs = np.zeros((2, 3))
        compensation_step(self._inputs, self.numbers, 0.001, self.state, self.torque)
        self.rest()

    @classmethod
    def from_parameters(cls, values: Mapping[str, Any], source: str = "parameters") -> OmniCompensation:
        """From `compensation.level.kp` and so on. Raises ConfigurationError naming source and parameter."""
        try:
            return cls(from_parameters(CompensationSettings, values, PREFIX))
        except ConfigurationError as error:
            raise ConfigurationError(f"{source}: {PREFIX}{error}") from error

    def step(self, position: ArrayLike, velocity: ArrayLike, dt: float) -> Array:
        """Torques (3,), N·m, to be added to the command until the next sample, from angles (3,), rad, about
        the neutral position and velocities (3,), rad/s; dt s since the last sample. A view. Zero for
        values that are no numbers."""
        self._inputs[0] = position
        self._inputs[1] = velocity
        compensation_step(self._inputs, self.numbers, dt, self.state, self.torque)
        return self.torque

    def rest(self) -> None:
        """The device is not driven: the next torques ramp in again, from an empty integral."""
        self.state[:] = 0.0
        self.torque[:] = 0.0


@njit(cache=True)
def compensation_step(inputs, settings, dt, state, torque):  # type: ignore[no-untyped-def]
    """One sample: fills `torque` (3,) and changes `state` (2,).

    inputs: (2, 3), rows angle and velocity. settings: (9,) in the order of CompensationSettings' fields.
    """
    kp, ki, kd, level, spring, rest, bias, limit, ramp = (
        settings[0], settings[1], settings[2], settings[3], settings[4], settings[5], settings[6],
        settings[7], settings[8],
    )  # fmt: skip
    torque[:] = 0.0
    error = level - inputs[0, 0]
    counter = spring * (inputs[0, 1] - rest)
    if not (math.isfinite(error) and math.isfinite(inputs[1, 0]) and math.isfinite(counter)):
        return
    share = 1.0 if state[1] >= ramp else state[1] / ramp
    state[1] += dt
    proportional = kp * error - kd * inputs[1, 0]
    increment = ki * error * dt
    wanted = proportional + state[0] + increment
    # The integral goes no further than the limit, so that it does not wind up while somebody holds X.
    if not ((wanted > limit and increment > 0.0) or (wanted < -limit and increment < 0.0)):
        state[0] = min(max(state[0] + increment, -limit), limit)
    torque[0] = share * min(max(proportional + state[0], -limit), limit)
    torque[1] = share * min(max(counter, -limit), limit)
    torque[2] = share * min(max(bias, -limit), limit)
