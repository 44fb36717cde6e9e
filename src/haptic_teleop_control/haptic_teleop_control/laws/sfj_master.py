"""The 2DSFJ as master (scenario 2): the elastic joint is the torque sensor, the drive moves for the feedback.

    T_h   = Ks (theta_a - theta_m)                    torque of the hand on the arm, CCW positive
    Td    = torque_gain T_h                           less a dead zone of T_h
    th_m* = base - (feedback_gain LP(Te) + T_x) / Ks  where the drive is to be
    Ic    = Kpm (th_m* - theta_m) - Kdm theta_m'      commanded current, as (32)

The harmonic drive cannot be pushed back by hand, so the drive holds its place and the joint's deflection
measures the hand. When the slave presses on its environment the drive draws back under the hand: at the same
angle of the arm the joint is deflected further by feedback_gain Te / Ks, and the hand has to give
feedback_gain Te more. T_x is a further resisting torque, such as the passivity controller's damping.

`base` moves from where the drive was at `reset` to the neutral position, at `return_speed` at most. A hand
that holds the arm still turns feedback into more Td, so torque_gain x feedback_gain below 1 is what keeps
contact from feeding itself; the settings refuse more.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

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
from haptic_teleop_control.robots import SFJ_STAGES

_OK = int(LawResult.OK)
_SATURATED = int(LawResult.SATURATED)
_REFUSED_INPUT = int(LawResult.REFUSED_INPUT)


@dataclass(frozen=True)
class SfjMasterSettings:
    """One stage of the 2DSFJ in the operator's hand.

    Raises ConfigurationError naming the field for a value outside its range.
    """

    torque_gain: float = quantity(
        0.2, "", "desired torque of the slave per torque of the hand on the arm", minimum=0.0
    )
    dead_zone: float = quantity(
        0.02,
        "N·m",
        "torque of the hand that asks for nothing; encoder error times stiffness is up to 0.014 N·m",
        minimum=0.0,
    )
    desired_torque_limit: float = quantity(
        math.inf, "N·m", "largest desired torque; .inf for none", above=0.0, infinite=True
    )
    neutral: float = quantity(0.0, "rad", "neutral position of the drive")
    return_speed: float = quantity(
        0.2, "rad/s", "speed at which the drive goes to its neutral position", above=0.0, maximum=1.0
    )
    feedback_gain: float = quantity(
        0.0, "", "felt share of the torque on the environment; 0 switches it off", minimum=0.0
    )
    feedback_cutoff_hz: float = quantity(
        math.inf, "Hz", "low-pass of the feedback; .inf for none", above=0.0, infinite=True
    )
    travel: float = quantity(
        0.25, "rad", "angle by which feedback may move the drive either way", minimum=0.0, maximum=1.0
    )
    kpm: float = quantity(60.0, "A/rad", "gain of the drive's position error", above=0.0)
    kdm: float = quantity(0.5, "A·s/rad", "gain of the drive's velocity", minimum=0.0)
    stiffness: float = quantity(3.971, "N·m/rad", "stiffness Ks of the elastic joint", above=0.0)
    torque_constant: float = quantity(8.925, "N·m/A", "effort per current in messages", above=0.0)
    current_limit: float = quantity(0.94, "A", "largest current commanded", above=0.0)

    def __post_init__(self) -> None:
        check_quantities(self)
        if self.torque_gain * self.feedback_gain >= 1.0:
            raise ConfigurationError(
                f"feedback_gain {self.feedback_gain:g} with torque_gain {self.torque_gain:g} makes contact "
                "feed itself; keep their product below 1."
            )

    @classmethod
    def for_stage(cls, stage: str, **changes: float) -> SfjMasterSettings:
        """Settings with the nominal joint and amplifier of `stage` (a key of SFJ_STAGES), and `changes`.

        The gains were found in simulation. Raises ConfigurationError for another stage.
        """
        if stage not in SFJ_STAGES:
            raise ConfigurationError(f"stage {stage} is unknown; choose one of {', '.join(SFJ_STAGES)}.")
        facts = SFJ_STAGES[stage]
        own = {
            "stiffness": facts.stiffness,
            "torque_constant": facts.torque_constant,
            "current_limit": facts.current_limit,
        }
        return replace(cls(), **{**own, **changes})


class SfjMasterSide:
    """The master's side for n stages, stepped every dt s. Nothing raises while stepping.

    results: (n,), a LawResult for each stage: SATURATED when the current limit held.
    torque_constant: (n,), N·m/A.
    """

    def __init__(self, settings: Sequence[SfjMasterSettings], dt: float) -> None:
        if not settings:
            raise ConfigurationError("sfj master: no stage; give the settings of at least one.")
        if not (math.isfinite(dt) and dt > 0.0):
            raise ConfigurationError(f"sfj master: dt is {dt} s; choose a finite time above 0.")
        n = len(settings)
        self.dt, self.stages = float(dt), n
        self.results = np.zeros(n, dtype=np.int64)
        self._state = np.zeros((n, 4))  # base, filtered feedback, last feedback, whether started
        self._inputs = np.zeros((4, n))
        self._settings = tuple(settings)
        # The limit protects, and the constant converts.
        self._ramp = GainRamp(_matrix(self._settings, self.dt), self.dt, at_once=(7,))
        self._matrix = self._ramp.value
        self.torque_constant = np.array([one.torque_constant for one in settings])
        sfj_master_step(self._inputs, self._matrix, self.dt, self._state, self.results)
        self.reset()

    def desired(self, arm_torque: ArrayLike) -> Array:
        """Td (n,), N·m, from the effort of the arms, Te = Ks (theta_m - theta_a) = -T_h. No memory."""
        hand = -np.asarray(arm_torque, dtype=np.float64)
        beyond = np.sign(hand) * np.maximum(np.abs(hand) - self._matrix[:, 9], 0.0)
        limit = self._matrix[:, 10]
        return np.clip(self._matrix[:, 8] * beyond, -limit, limit)

    def step(
        self,
        motor_position: ArrayLike,
        motor_velocity: ArrayLike,
        feedback_torque: ArrayLike,
        resisting_torque: ArrayLike = 0.0,
    ) -> Array:
        """Commanded currents (n,), A, from theta_m, theta_m', Te of the slave and T_x; (n,) each.

        A stage with an input that is not finite gets zero and keeps its state. Raises ValueError when an
        argument does not have n values.
        """
        inputs = self._inputs
        inputs[0] = motor_position
        inputs[1] = motor_velocity
        inputs[2] = feedback_torque
        inputs[3] = resisting_torque
        if self._ramp.moving:
            self._ramp.step()
        return sfj_master_step(inputs, self._matrix, self.dt, self._state, self.results)

    def reset(self) -> None:
        """Start anew from where the drive will be at the next step."""
        self._state[:] = 0.0
        self._ramp.jump()

    @property
    def settings(self) -> tuple[SfjMasterSettings, ...]:
        """Settings of each stage; assigned ones hold from the next step on."""
        return self._settings

    @settings.setter
    def settings(self, settings: Sequence[SfjMasterSettings]) -> None:
        self._ramp.jump(self._checked(settings))

    def _checked(self, settings: Sequence[SfjMasterSettings]) -> Array:
        if len(settings) != self.stages:
            raise ConfigurationError(f"sfj master: settings of {len(settings)} stages; give {self.stages}.")
        self._settings = tuple(settings)
        self.torque_constant = np.array([one.torque_constant for one in self._settings])
        return _matrix(self._settings, self.dt)

    @classmethod
    def parameters(cls, stages: Sequence[str]) -> list[Parameter]:
        """A node's parameters, `stage1.master.torque_gain` and so on, with the defaults of each stage."""
        return parameters_of_each(_nominal(stages))

    @classmethod
    def from_parameters(cls, values: Mapping[str, Any], stages: Sequence[str], dt: float) -> Self:
        """The master's side from such parameters. Raises ConfigurationError naming the parameter."""
        return cls(settings_of_each(_nominal(stages), values), dt)

    def update(self, values: Mapping[str, Any], stages: Sequence[str]) -> None:
        """Take changed parameters while running, on a line of `gain_ramp.RAMP_TIME`. Raises
        ConfigurationError, and then has changed nothing."""
        self._ramp.to(self._checked(settings_of_each(_nominal(stages), values)))


def _nominal(stages: Sequence[str]) -> list[tuple[str, SfjMasterSettings]]:
    """(prefix of the parameters, nominal settings) of each stage."""
    return [(f"{stage}.master.", SfjMasterSettings.for_stage(stage)) for stage in stages]


def _matrix(settings: Sequence[SfjMasterSettings], dt: float) -> Array:
    """(n, 14): neutral, return speed, feedback gain, travel, Kpm, Kdm, Ks, current limit, torque gain, dead
    zone, limit of Td, three coefficients of the low-pass."""
    rows = [
        (
            s.neutral,
            s.return_speed,
            s.feedback_gain,
            s.travel,
            s.kpm,
            s.kdm,
            s.stiffness,
            s.current_limit,
            s.torque_gain,
            s.dead_zone,
            s.desired_torque_limit,
            *low_pass_coefficients(dt, s.feedback_cutoff_hz),
        )
        for s in settings
    ]
    return np.array(rows, dtype=np.float64)


@njit(cache=True)
def sfj_master_step(inputs, settings, dt, state, results):  # type: ignore[no-untyped-def]
    """One step for n stages; commanded currents (n,), A.

    inputs: (4, n), rows theta_m, theta_m', Te of the slave, T_x. settings: (n, 14) from `_matrix`. Changed in
    place: state (n, 4), results (n,) int64.
    """
    n = inputs.shape[1]
    current = np.zeros(n)
    for i in range(n):
        motor, velocity, feedback, extra = inputs[0, i], inputs[1, i], inputs[2, i], inputs[3, i]
        base = state[i, 0] if state[i, 3] != 0.0 else motor
        way = settings[i, 1] * dt
        base += min(max(settings[i, 0] - base, -way), way)
        felt = settings[i, 11] * state[i, 1] + settings[i, 12] * state[i, 2] + settings[i, 13] * feedback
        shift = (settings[i, 2] * felt + extra) / settings[i, 6]
        shift = min(max(shift, -settings[i, 3]), settings[i, 3])
        wanted = settings[i, 4] * (base - shift - motor) - settings[i, 5] * velocity
        if not (math.isfinite(wanted) and math.isfinite(feedback + extra)):
            results[i] = _REFUSED_INPUT
            continue
        state[i, 0], state[i, 1], state[i, 2], state[i, 3] = base, felt, feedback, 1.0
        limit = settings[i, 7]
        current[i] = min(max(wanted, -limit), limit)
        results[i] = _SATURATED if abs(wanted) > limit else _OK
    return current
