"""Force control by an augmented error, equations (25) to (32) of the thesis, for each stage of the 2DSFJ.

    Te    = Ks (theta_m - theta_a)             torque of the robot on its environment            (26)
    s     = Td - Te - lambda theta_m'          augmented error                                   (27)
    Tc    = Te + Kp s + Ki integral(s)         commanded torque                                  (29)
    th_md = theta_a + Tc / Ks                  desired motor position                            (31)
    Ic    = Kpm (th_md - theta_m) - Kdm theta_m'   commanded current                             (32)

In free motion Te = 0, so s = 0 means theta_m' = Td / lambda (28); in contact at rest s = 0 means Te = Td. The
same gains serve both. Because (31) cancels the Te of (29), contact torque is held by the integrator alone:
Ic = Kpm / Ks (Kp s + Ki integral(s)) - Kdm theta_m'. So the integrator must survive the current limit
unharmed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from haptic_teleop_control.compiled import njit
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.laws.contract import Array, ForceLaw, LawResult
from haptic_teleop_control.laws.gain_ramp import GainRamp
from haptic_teleop_control.parameters import Parameter
from haptic_teleop_control.quantities import (
    check_quantities,
    parameters_of_each,
    quantity,
    settings_of_each,
)
from haptic_teleop_control.robots import SFJ_STAGES

_OK = int(LawResult.OK)
_SATURATED = int(LawResult.SATURATED)
_REFUSED_INPUT = int(LawResult.REFUSED_INPUT)
_DISABLED = int(LawResult.DISABLED)


@dataclass(frozen=True)
class AugmentedErrorGains:
    """The five gains of one stage and what its joint and amplifier are.

    Raises ConfigurationError naming the field for a value outside its range.
    """

    lambda_: float = quantity(
        unit="N·m·s/rad",
        meaning="velocity penalty; speed in free motion is Td/lambda",
        name="lambda",
        above=0.0,
    )
    kp: float = quantity(meaning="proportional gain on the augmented error", minimum=0.0)
    ki: float = quantity(unit="1/s", meaning="integral gain on the augmented error", minimum=0.0)
    kpm: float = quantity(unit="A/rad", meaning="gain of the motor's position error", above=0.0)
    kdm: float = quantity(unit="A·s/rad", meaning="gain of the motor's velocity", minimum=0.0)
    stiffness: float = quantity(unit="N·m/rad", meaning="stiffness Ks of the elastic joint", above=0.0)
    torque_constant: float = quantity(unit="N·m/A", meaning="effort per current in messages", above=0.0)
    current_limit: float = quantity(unit="A", meaning="largest current commanded", above=0.0)

    def __post_init__(self) -> None:
        check_quantities(self)

    @classmethod
    def for_stage(cls, stage: str, **changes: float) -> AugmentedErrorGains:
        """Gains with the nominal joint and amplifier of `stage` (a key of SFJ_STAGES), and `changes` to them.

        lambda is the thesis' (4.4.1); the other four were found in simulation, because the table with the
        thesis' own is lost. Raises ConfigurationError for another stage.
        """
        if stage not in SFJ_STAGES:
            raise ConfigurationError(f"stage {stage} is unknown; choose one of {', '.join(SFJ_STAGES)}.")
        facts = SFJ_STAGES[stage]
        gains = cls(0.5, 2.0, 10.0, 5.0, 0.05, facts.stiffness, facts.torque_constant, facts.current_limit)
        return replace(gains, **changes)


class AugmentedErrorLaw(ForceLaw):
    """The law for all stages together, stepped every dt.

    The integral is the sum of s dt with the newest sample included. It is kept as a torque, Ki times the
    integral, so that a change of gains does not make the current jump.

    Anti-windup: an increment that would drive the current beyond its limit is taken only as far as the limit,
    and not at all while the current is beyond it for other reasons. The integral is never moved backwards, so
    a contact torque that it holds survives a saturated transient.

    state: (n, 1), Ki integral(s) in N·m. augmented_error, environment_torque: (n,), s and Te of the last
    step, N·m, NaN where the input was refused.
    """

    def __init__(self, gains: Sequence[AugmentedErrorGains], dt: float) -> None:
        if not gains:
            raise ConfigurationError("augmented_error: no stage; give the gains of at least one.")
        if not (math.isfinite(dt) and dt > 0.0):
            raise ConfigurationError(f"augmented_error: dt is {dt} s; choose a finite time above 0.")
        self.dt = float(dt)
        self.stages = len(gains)
        self.enabled = np.ones(self.stages, dtype=np.bool_)
        self.results = np.zeros(self.stages, dtype=np.int64)
        self._state = np.zeros((self.stages, 1))
        self._inputs = np.zeros((4, self.stages))
        self._inner = np.zeros((2, self.stages))
        self._gains = tuple(gains)
        # Limit and conversion from torque to current hold at once.
        self._ramp = GainRamp(_matrix(self._gains), self.dt, at_once=(6, 7))
        self._matrix = self._ramp.value
        self.torque_constant = self._matrix[:, 6].copy()
        # Compiles now, on zeros, instead of in the loop.
        augmented_error_step(
            self._inputs, self._matrix, self.dt, self.enabled, self._state, self.results, self._inner
        )

    def step(
        self,
        desired_torque: ArrayLike,
        motor_position: ArrayLike,
        arm_position: ArrayLike,
        motor_velocity: ArrayLike,
    ) -> Array:
        if self._ramp.moving:
            self._change_gains(self._ramp.step)
        inputs = self._inputs
        inputs[0] = desired_torque
        inputs[1] = motor_position
        inputs[2] = arm_position
        inputs[3] = motor_velocity
        return augmented_error_step(
            inputs, self._matrix, self.dt, self.enabled, self._state, self.results, self._inner
        )

    def reset(self, stage: int | None = None) -> None:
        if stage is None:
            self._state[:] = 0.0
            self._ramp.jump()
        else:
            self._state[stage] = 0.0

    @property
    def state(self) -> Array:
        return self._state.copy()

    @state.setter
    def state(self, value: ArrayLike) -> None:
        self._state[:] = np.asarray(value, dtype=np.float64).reshape(self._state.shape)

    @property
    def augmented_error(self) -> Array:
        return self._inner[0].copy()

    @property
    def environment_torque(self) -> Array:
        return self._inner[1].copy()

    @property
    def gains(self) -> tuple[AugmentedErrorGains, ...]:
        """Gains of each stage. Assigning others keeps the current that the integrator contributes."""
        return self._gains

    @gains.setter
    def gains(self, gains: Sequence[AugmentedErrorGains]) -> None:
        new = self._checked(gains)
        self._change_gains(lambda: self._ramp.jump(new))
        self.torque_constant = new[:, 6].copy()

    def _checked(self, gains: Sequence[AugmentedErrorGains]) -> Array:
        if len(gains) != self.stages:
            raise ConfigurationError(f"augmented_error: gains of {len(gains)} stages; give {self.stages}.")
        self._gains = tuple(gains)
        return _matrix(self._gains)

    def _change_gains(self, change: Callable[[], None]) -> None:
        before = self._matrix[:, 3] / self._matrix[:, 5]
        change()
        self._state[:, 0] *= before / (self._matrix[:, 3] / self._matrix[:, 5])

    @classmethod
    def parameters(cls, stages: Sequence[str]) -> list[Parameter]:
        return parameters_of_each(_nominal(stages))

    @classmethod
    def from_parameters(cls, values: Mapping[str, Any], stages: Sequence[str], dt: float) -> Self:
        return cls(settings_of_each(_nominal(stages), values), dt)

    def update(self, values: Mapping[str, Any], stages: Sequence[str]) -> None:
        new = self._checked(settings_of_each(_nominal(stages), values))
        self._ramp.to(new)
        self.torque_constant = new[:, 6].copy()


def _nominal(stages: Sequence[str]) -> list[tuple[str, AugmentedErrorGains]]:
    """(prefix of the parameters, nominal gains) of each stage."""
    return [(f"{stage}.", AugmentedErrorGains.for_stage(stage)) for stage in stages]


def _matrix(gains: Sequence[AugmentedErrorGains]) -> Array:
    """(n, 8), columns in the order of the fields of AugmentedErrorGains."""
    rows = [
        (g.lambda_, g.kp, g.ki, g.kpm, g.kdm, g.stiffness, g.torque_constant, g.current_limit) for g in gains
    ]
    return np.array(rows, dtype=np.float64)


@njit(cache=True)
def augmented_error_step(inputs, gains, dt, enabled, state, results, inner):  # type: ignore[no-untyped-def]
    """One step for n stages; commanded currents (n,), A.

    inputs: (4, n), rows Td, theta_m, theta_a, theta_m'. gains: (n, 8), columns lambda, Kp, Ki, Kpm, Kdm, Ks,
    torque constant, current limit. enabled: (n,) bool. Changed in place: state (n, 1), results (n,) int64,
    inner (2, n) with rows s and Te.
    """
    n = inputs.shape[1]
    current = np.zeros(n)
    for i in range(n):
        desired, motor, arm, velocity = inputs[0, i], inputs[1, i], inputs[2, i], inputs[3, i]
        penalty, kp, ki, kpm, kdm, stiffness = (
            gains[i, 0],
            gains[i, 1],
            gains[i, 2],
            gains[i, 3],
            gains[i, 4],
            gains[i, 5],
        )
        limit = gains[i, 7]

        environment = stiffness * (motor - arm)
        s = desired - environment - penalty * velocity
        if not enabled[i]:
            inner[0, i], inner[1, i] = s, environment
            state[i, 0] = 0.0
            results[i] = _DISABLED
            continue

        held = state[i, 0]
        increment = ki * s * dt
        commanded_torque = environment + kp * s + held + increment
        desired_motor = arm + commanded_torque / stiffness
        wanted = kpm * (desired_motor - motor) - kdm * velocity
        if not math.isfinite(wanted):
            inner[0, i], inner[1, i] = math.nan, math.nan
            results[i] = _REFUSED_INPUT
            continue
        inner[0, i], inner[1, i] = s, environment

        # How much of the increment lies beyond the limit on the side to which it pushes.
        excess = 0.0
        if wanted > limit and increment > 0.0:
            excess = min(increment, (wanted - limit) * stiffness / kpm)
        elif wanted < -limit and increment < 0.0:
            excess = max(increment, (wanted + limit) * stiffness / kpm)
        state[i, 0] = held + (increment - excess)
        current[i] = min(max(wanted, -limit), limit)
        results[i] = _SATURATED if abs(wanted) > limit else _OK
    return current
