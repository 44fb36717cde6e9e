"""The Omni as slave (scenario 2): the augmented-error law on a torque that is estimated, not measured.

    J phi'' = T + Ts(phi) - Tf(phi') - Te           one axis; Te is its torque on the environment
    Tf(v)   = Fv v + (Fc + Fcs sech(alpha v)) tanh(beta v)                                  (22)
    Te_hat  = LP[ F(T + Ts) - Tf(v) - J v' ]        momentum observer, first order, bandwidth Ko
    s       = Td - Te_hat - lambda v                                                        (25), (27)
    T       = Te_hat + Kp s + Ki integral(s)                                                (29)

The device has no force sensor, so the environment's torque is what is left of the momentum balance. v is the
filtered velocity; F is that same filter without its derivative, so that torque and momentum are equally old
and an acceleration leaves no trace in the estimate. The motor torque is commanded directly: (30) to (32),
which go through an elastic joint, have no part here.

Blind zone: equation (22) gives no friction at standstill, where friction is whatever holds the axis, at most
Fc + Fcs. There the estimate cannot tell friction from environment. `standstill` says how much of the torque
at rest is laid to friction: with 0, as (22) has it, all of it counts as environment, and no |Td| below
Fc + Fcs moves the axis; with 1 every Td moves it in the end, and contact is pressed by up to Fc + Fcs too
much. Either way the estimate at rest is uncertain by Fc + Fcs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from haptic_teleop_control.compiled import njit
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.filters import velocity_coefficients, velocity_step
from haptic_teleop_control.laws.contract import Array, LawResult
from haptic_teleop_control.laws.gain_ramp import GainRamp
from haptic_teleop_control.parameters import Parameter
from haptic_teleop_control.quantities import (
    check_quantities,
    parameters_of_each,
    quantity,
    settings_of_each,
)
from haptic_teleop_control.robots import (
    OMNI_AXES,
    OMNI_PEAK_TORQUE,
    VELOCITY_FILTER_CUTOFF_HZ,
    VELOCITY_FILTER_DAMPING,
)

_OK = int(LawResult.OK)
_SATURATED = int(LawResult.SATURATED)
_REFUSED_INPUT = int(LawResult.REFUSED_INPUT)
_DISABLED = int(LawResult.DISABLED)


@dataclass(frozen=True)
class OmniSlaveSettings:
    """One axis: the law's gains, and the model by which the observer knows the axis.

    Raises ConfigurationError naming the field for a value outside its range.
    """

    lambda_: float = quantity(
        0.2, "N·m·s/rad", "velocity penalty; speed in free motion is Td/lambda", name="lambda", above=0.0
    )
    kp: float = quantity(0.4, "", "proportional gain on the augmented error", minimum=0.0)
    ki: float = quantity(2.0, "1/s", "integral gain on the augmented error", minimum=0.0)
    torque_limit: float = quantity(
        OMNI_PEAK_TORQUE, "N·m", "largest torque commanded", above=0.0, maximum=OMNI_PEAK_TORQUE
    )
    bandwidth: float = quantity(
        100.0, "rad/s", "of the torque observer", name="observer.bandwidth", above=0.0
    )
    inertia: float = quantity(2.526e-3, "kg·m²", "of the axis", name="observer.inertia", above=0.0)
    viscous: float = quantity(
        2.0e-3, "N·m·s/rad", "Fv, viscous friction", name="observer.viscous", minimum=0.0
    )
    coulomb: float = quantity(0.02, "N·m", "Fc, friction at high speed", name="observer.coulomb", minimum=0.0)
    stribeck: float = quantity(
        0.01, "N·m", "Fcs, by how much it is larger at low speed", name="observer.stribeck", minimum=0.0
    )
    alpha: float = quantity(
        5.0, "s/rad", "how fast Fcs fades with speed", name="observer.alpha", minimum=0.0
    )
    beta: float = quantity(
        50.0, "s/rad", "how sharply it turns with the direction", name="observer.beta", above=0.0
    )
    spring: float = quantity(
        0.0, "N·m/rad", "the device's internal spring", name="observer.spring", minimum=0.0
    )
    spring_rest: float = quantity(0.0, "rad", "where that spring is relaxed", name="observer.spring_rest")
    standstill: float = quantity(
        0.0,
        "",
        "share of the torque at rest that counts as friction, up to the breakaway torque",
        name="observer.standstill",
        minimum=0.0,
        maximum=1.0,
    )

    def __post_init__(self) -> None:
        check_quantities(self)

    @classmethod
    def for_axis(cls, axis: str, **changes: float) -> OmniSlaveSettings:
        """Settings with the nominal inertia and spring of `axis` ("omni_y" or "omni_z"), and `changes`.

        The gains were found in simulation; the friction is that of the built-in model, which is assumed.
        Raises ConfigurationError for an axis without a known inertia.
        """
        facts = OMNI_AXES.get(axis)
        if facts is None or facts.inertia is None:
            raise ConfigurationError(f"axis {axis} is unknown; choose omni_y or omni_z.")
        own = replace(
            cls(), inertia=facts.inertia, spring=facts.spring_stiffness, spring_rest=facts.spring_rest
        )
        return replace(own, **changes)


class OmniSlaveLaw:
    """The law for n axes, stepped every dt s. Nothing raises while stepping; what happened is in `results`.

    enabled: (n,) bool, writable; a disabled axis gets zero, its integrator is empty, its observer goes on.
    results: (n,), a LawResult for each axis. augmented_error, environment_torque, friction: (n,), s, Te_hat
    and Tf of the last step, N·m.
    """

    def __init__(self, settings: Sequence[OmniSlaveSettings], dt: float) -> None:
        if not settings:
            raise ConfigurationError("omni slave: no axis; give the settings of at least one.")
        if not (math.isfinite(dt) and dt > 0.0):
            raise ConfigurationError(f"omni slave: dt is {dt} s; choose a finite time above 0.")
        n = len(settings)
        self.dt, self.axes = float(dt), n
        self.enabled = np.ones(n, dtype=np.bool_)
        self.results = np.zeros(n, dtype=np.int64)
        self._settings = tuple(settings)
        self._ramp = GainRamp(_matrix(self._settings), self.dt, at_once=(3,))  # the limit protects
        self._matrix = self._ramp.value
        self._filter = velocity_coefficients(self.dt, VELOCITY_FILTER_CUTOFF_HZ, VELOCITY_FILTER_DAMPING)
        self._inputs = np.zeros((4, n))
        self._inner = np.zeros((3, n))
        self._state = np.zeros((n, STATES))
        omni_slave_step(  # compiles now, on zeros, instead of in the loop
            self._inputs, self._matrix, self.dt, self._filter, self.enabled, self._state, self.results,
            self._inner,
        )  # fmt: skip
        self.reset()

    def step(
        self, desired_torque: ArrayLike, position: ArrayLike, velocity: ArrayLike, applied_torque: ArrayLike
    ) -> Array:
        """Commanded torques (n,), N·m, from Td, phi, phi' and the torque that acted since the last sample.

        Raises ValueError when an argument does not have n values.
        """
        inputs = self._inputs
        inputs[0] = desired_torque
        inputs[1] = position
        inputs[2] = velocity
        inputs[3] = applied_torque
        if self._ramp.moving:
            self._ramp.step()
        return omni_slave_step(
            inputs, self._matrix, self.dt, self._filter, self.enabled, self._state, self.results, self._inner
        )

    def reset(self) -> None:
        """Forget the past: the next sample starts the observer, with no torque on the environment."""
        self._state[:] = 0.0
        self._ramp.jump()

    def release(self) -> None:
        """Empty the integrators alone; the observer goes on."""
        self._state[:, 0] = 0.0
        self._ramp.jump()

    @property
    def augmented_error(self) -> Array:
        return self._inner[0].copy()

    @property
    def environment_torque(self) -> Array:
        """A view, overwritten by the next step."""
        return self._inner[1]

    @property
    def friction(self) -> Array:
        return self._inner[2].copy()

    @property
    def settings(self) -> tuple[OmniSlaveSettings, ...]:
        """Settings of each axis; assigned ones hold from the next step on. The integral is kept as a
        torque."""
        return self._settings

    @settings.setter
    def settings(self, settings: Sequence[OmniSlaveSettings]) -> None:
        self._ramp.jump(self._checked(settings))

    def _checked(self, settings: Sequence[OmniSlaveSettings]) -> Array:
        if len(settings) != self.axes:
            raise ConfigurationError(f"omni slave: settings of {len(settings)} axes; give {self.axes}.")
        self._settings = tuple(settings)
        return _matrix(self._settings)

    @classmethod
    def parameters(cls, axes: Sequence[str]) -> list[Parameter]:
        """A node's parameters, `omni_y.slave.lambda` and so on, with the defaults of each axis."""
        return parameters_of_each(_nominal(axes))

    @classmethod
    def from_parameters(cls, values: Mapping[str, Any], axes: Sequence[str], dt: float) -> Self:
        """The law from such parameters. Raises ConfigurationError naming the parameter."""
        return cls(settings_of_each(_nominal(axes), values), dt)

    def update(self, values: Mapping[str, Any], axes: Sequence[str]) -> None:
        """Take changed parameters while running, on a line of `gain_ramp.RAMP_TIME`. Raises
        ConfigurationError, and then has changed nothing."""
        self._ramp.to(self._checked(settings_of_each(_nominal(axes), values)))


def _nominal(axes: Sequence[str]) -> list[tuple[str, OmniSlaveSettings]]:
    """(prefix of the parameters, nominal settings) of each axis."""
    return [(f"{axis}.slave.", OmniSlaveSettings.for_axis(axis)) for axis in axes]


def _matrix(settings: Sequence[OmniSlaveSettings]) -> Array:
    """(n, 14), columns in the order of the fields of OmniSlaveSettings."""
    return np.array([astuple(one) for one in settings], dtype=np.float64)


STATES = 7
"""Of one axis: Ki integral(s); Te_hat; last velocity; filter of the torque (3); whether it has started."""


@njit(cache=True)
def friction_torque(velocity, imbalance, viscous, coulomb, stribeck, alpha, beta, standstill):  # type: ignore[no-untyped-def]
    """Tf of equation (22), N·m; near standstill friction takes `standstill` of `imbalance`, the torque
    that nothing else explains, as far as it can: the tanh's share of its size is already spoken for."""
    size = coulomb + stribeck / math.cosh(min(abs(alpha * velocity), 300.0))
    moving = math.tanh(beta * velocity)
    rest = (1.0 - abs(moving)) * standstill * min(max(imbalance, -size), size)
    return viscous * velocity + size * moving + rest


@njit(cache=True)
def omni_slave_step(inputs, settings, dt, coefficients, enabled, state, results, inner):  # type: ignore[no-untyped-def]
    """One step for n axes; commanded torques (n,), N·m.

    inputs: (4, n), rows Td, phi, phi', torque applied since the last sample. settings: (n, 14) from
    `_matrix`. coefficients: of the velocity filter. enabled: (n,) bool. Changed in place: state (n, STATES),
    results (n,) int64, inner (3, n) with rows s, Te_hat, Tf; an axis whose input is refused keeps its state.
    """
    n = inputs.shape[1]
    torque = np.zeros(n)
    one = np.zeros(1)
    memory = np.zeros((1, 3))
    for i in range(n):
        desired, angle, velocity, applied = inputs[0, i], inputs[1, i], inputs[2, i], inputs[3, i]
        penalty, kp, ki, limit, bandwidth, inertia = (
            settings[i, 0], settings[i, 1], settings[i, 2], settings[i, 3], settings[i, 4], settings[i, 5],
        )  # fmt: skip
        driving = applied - settings[i, 11] * (angle - settings[i, 12])
        if not math.isfinite(desired + velocity + driving):
            inner[0, i], inner[1, i], inner[2, i] = math.nan, math.nan, math.nan
            results[i] = _REFUSED_INPUT
            continue
        if state[i, 6] == 0.0:  # as if everything had been like this for ever
            state[i, 2] = velocity
            state[i, 3], state[i, 4], state[i, 5] = driving, 0.0, driving
            state[i, 6] = 1.0
        one[0] = driving
        memory[0, 0], memory[0, 1], memory[0, 2] = state[i, 3], state[i, 4], state[i, 5]
        velocity_step(one, memory, coefficients)
        momentum_rate = inertia * (velocity - state[i, 2]) / dt
        imbalance = memory[0, 0] - momentum_rate
        share = 1.0 - math.exp(-bandwidth * dt)
        friction = friction_torque(
            velocity, imbalance - settings[i, 6] * velocity, settings[i, 6], settings[i, 7], settings[i, 8],
            settings[i, 9], settings[i, 10], settings[i, 13],
        )  # fmt: skip
        environment = state[i, 1] + share * (imbalance - friction - state[i, 1])
        s = desired - environment - penalty * velocity
        held = state[i, 0] if enabled[i] else 0.0
        increment = ki * s * dt if enabled[i] else 0.0
        wanted = environment + kp * s + held + increment
        if not math.isfinite(wanted):
            inner[0, i], inner[1, i], inner[2, i] = math.nan, math.nan, math.nan
            results[i] = _REFUSED_INPUT
            continue
        inner[0, i], inner[1, i], inner[2, i] = s, environment, friction
        state[i, 1], state[i, 2] = environment, velocity
        state[i, 3], state[i, 4], state[i, 5] = memory[0, 0], memory[0, 1], memory[0, 2]
        if not enabled[i]:
            state[i, 0] = 0.0
            results[i] = _DISABLED
            continue
        # Anti-windup as in the law of the 2DSFJ: no further than the limit, and never backwards.
        excess = 0.0
        if wanted > limit and increment > 0.0:
            excess = min(increment, wanted - limit)
        elif wanted < -limit and increment < 0.0:
            excess = max(increment, wanted + limit)
        state[i, 0] = held + (increment - excess)
        torque[i] = min(max(wanted, -limit), limit)
        results[i] = _SATURATED if abs(wanted) > limit else _OK
    return torque
