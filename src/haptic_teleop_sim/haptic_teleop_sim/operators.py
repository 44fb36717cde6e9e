"""The operator's hand on the Omni: a passive impedance that holds a posture, moves along via points or
follows a target that somebody gives.

    torque of the hand on an axis = stiffness (target - phi) + damping (target' - phi') - inertia phi''

The part that depends on the axis becomes part of the plant (`Operator.grip`): inside the dynamics, where a
spring and a damper can only dissipate, whatever the sampling time. What is left is `Operator.pull`, a
function of time alone. Of one hand the three axes are taken as independent.

Between via points the hand moves with minimum jerk, from rest to rest (Flash and Hogan, J. Neurosci. 5, 1985,
1688-1703). A given target may jump, a hand does not: it follows through a critically damped low-pass.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.parameters import Parameter
from haptic_teleop_control.quantities import check_quantities, from_parameters, parameters_of, quantity
from haptic_teleop_control.robots import OMNI_JOINTS

from .joint_hardware import JointHardware
from .model import Effect, Model

Array = NDArray[np.float64]
MODES = ("none", "hold", "trajectory", "follow")


@dataclass(frozen=True)
class Hand:
    """Impedance of the hand about one axis, and where it wants to be.

    The values are *assumed*: a relaxed grip of some 0.05 kg, 3 N·s/m and 160 N/m at the end of a 0.135 m
    link. Raises ConfigurationError naming the field for a value outside its range.
    """

    inertia: float = quantity(
        1.0e-3, "kg·m²", "moving mass of the hand about the axis (assumed)", minimum=0.0
    )
    damping: float = quantity(0.05, "N·m·s/rad", "damping of the hand (assumed)", minimum=0.0)
    stiffness: float = quantity(3.0, "N·m/rad", "stiffness of the hand (assumed)", minimum=0.0)
    posture: float = quantity(0.0, "rad", "angle at which the hand holds", minimum=-1.6, maximum=1.6)
    times: tuple[float, ...] = quantity(
        (0.0,), "s", "via points: when the hand is there, increasing", minimum=0.0
    )
    angles: tuple[float, ...] = quantity(
        (0.0,), "rad", "via points: where the hand is then", minimum=-1.6, maximum=1.6
    )

    def __post_init__(self) -> None:
        check_quantities(self)
        if len(self.times) != len(self.angles):
            raise ConfigurationError(
                f"hand.angles has {len(self.angles)} elements and hand.times {len(self.times)}; "
                "give as many of both."
            )
        if any(later <= earlier for earlier, later in zip(self.times, self.times[1:], strict=False)):
            raise ConfigurationError("hand.times do not increase; put them in order, each once.")

    def target(self, t: ArrayLike) -> tuple[Array, Array]:
        """Angle, rad, and its rate, rad/s, of the trajectory at the times t, s; at rest before and after it.
        """
        times, angles = np.asarray(self.times), np.asarray(self.angles)
        t = np.asarray(t, dtype=np.float64)
        if len(times) == 1:
            return np.full(t.shape, angles[0]), np.zeros(t.shape)
        piece = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 2)
        span = times[piece + 1] - times[piece]
        s = np.clip((t - times[piece]) / span, 0.0, 1.0)
        way = angles[piece + 1] - angles[piece]
        return (
            angles[piece] + way * s**3 * (10.0 - 15.0 * s + 6.0 * s**2),
            way / span * 30.0 * s**2 * (1.0 - s) ** 2,
        )


OPERATOR_PARAMETERS: list[Parameter] = [
    Parameter(
        "operator.mode",
        "none",
        choices=MODES,
        meaning="none: nobody holds the device; hold: at the posture; "
        "trajectory: along the via points; follow: after the reference",
    ),
    Parameter("operator.bandwidth_hz", 2.0, "Hz", above=0.0, meaning="how fast the hand follows (assumed)"),
    *(
        parameter
        for axis in OMNI_JOINTS
        for parameter in parameters_of(Hand(), f"{axis}.hand.", runtime=False)
    ),
]
"""Parameters of the operator; part of OMNI_PARAMETERS."""


@dataclass(frozen=True)
class Operator:
    """Who holds the device: a mode of MODES, the hand about each axis, and how fast it follows (Hz)."""

    mode: str = "none"
    hands: tuple[Hand, ...] = field(default_factory=lambda: tuple(Hand() for _ in OMNI_JOINTS))
    bandwidth_hz: float = 2.0

    def __post_init__(self) -> None:
        if self.mode not in MODES:
            raise ConfigurationError(f"operator.mode is {self.mode!r}; choose {' | '.join(MODES)}.")

    @classmethod
    def from_parameters(cls, values: Mapping[str, Any], source: str = "parameters") -> Self:
        """From flat parameters; ConfigurationError names source, key and remedy."""
        hands = []
        for axis in OMNI_JOINTS:
            try:
                hands.append(from_parameters(Hand, values, f"{axis}.hand."))
            except ConfigurationError as error:
                raise ConfigurationError(f"{source}: {axis}.{error}") from error
        return cls(values["operator.mode"], tuple(hands), values["operator.bandwidth_hz"])

    def grip(self, axes: Sequence[JointHardware]) -> tuple[JointHardware, ...]:
        """The axes with the hand's inertia, damping and stiffness (about zero) in their plants."""
        if self.mode == "none":
            return tuple(axes)
        return tuple(
            replace(axis, model=grip_model(axis.model, hand))
            for axis, hand in zip(axes, self.hands, strict=True)
        )

    def pulls(self, t: Array, targets: Array | None = None) -> Array:
        """Torque (time, axes), N·m, that the hand adds at the times t, s, to its impedance about zero.
        `targets` (time, axes), rad, matter in mode follow only; NaN is no target yet, and the posture holds.
        """
        torque = np.zeros((len(t), len(self.hands)))
        if self.mode == "follow" and targets is not None:
            dt = float(t[1] - t[0]) if len(t) > 1 else 1.0
            return Follower(self, dt).torques(targets)
        for i, hand in enumerate(self.hands):
            if self.mode == "trajectory":
                target, rate = hand.target(t)
                torque[:, i] = hand.stiffness * target + hand.damping * rate
            elif self.mode != "none":
                torque[:, i] = hand.stiffness * hand.posture
        return torque


class Follower:
    """The hand's way after targets that are given sample by sample, every dt s."""

    def __init__(self, operator: Operator, dt: float) -> None:
        self._stiffness = np.array([hand.stiffness for hand in operator.hands])
        self._damping = np.array([hand.damping for hand in operator.hands])
        self._posture = np.array([hand.posture for hand in operator.hands])
        self._rate = 2.0 * math.pi * operator.bandwidth_hz
        self._dt = dt
        self.reset()

    def reset(self) -> None:
        """The hand at its posture, at rest."""
        self._state = np.stack([self._posture, np.zeros_like(self._posture)])

    def torques(self, targets: Array) -> Array:
        """(time, axes), N·m, as `Operator.pulls`, for the next targets (time, axes), rad."""
        wanted = np.where(np.isfinite(targets), targets, self._posture)
        return follow(wanted, self._state, self._rate, self._dt, self._stiffness, self._damping)


@njit(cache=True)
def follow(targets, state, rate, dt, stiffness, damping):  # type: ignore[no-untyped-def]
    """Torques (time, axes) of a hand that follows `targets` (time, axes), held between samples, with both
    poles at -`rate` 1/s; exact. `state` (2, axes): angle and rate of the hand, moved on.
    """
    torques = np.empty(targets.shape)
    decay = math.exp(-rate * dt)
    for k in range(targets.shape[0]):
        for i in range(targets.shape[1]):
            torques[k, i] = stiffness[i] * state[0, i] + damping[i] * state[1, i]
            error = state[0, i] - targets[k, i]
            slope = state[1, i] + rate * error
            state[0, i] = targets[k, i] + (error + slope * dt) * decay
            state[1, i] = (state[1, i] - rate * slope * dt) * decay
    return torques


def grip_model(model: Model, hand: Hand) -> Model:
    """`model` with the hand's inertia, damping and spring about zero where the operator holds it: at the arm,
    or at the body when it is rigid.
    """
    place = "motor" if model.rigid else "arm"
    location = model.location(place)
    parameters = dict(model.parameters)
    parameters[f"{place}_inertia"] += hand.inertia
    parameters[f"{place}_damping"] += hand.damping
    stiffness, moment, others = hand.stiffness, 0.0, []
    for effect in model.effects:
        if (effect.effect, effect.location) == ("spring_to_ground", location):
            # Two springs side by side are one, at rest where their torques cancel.
            stiffness += effect.values["stiffness"]
            moment += effect.values["stiffness"] * effect.values["rest"]
        else:
            others.append(effect)
    if stiffness > 0.0:
        spring = {"stiffness": stiffness, "rest": moment / stiffness}
        others.append(Effect("spring_to_ground", location, spring))
    return replace(model, parameters=parameters, effects=tuple(others))
