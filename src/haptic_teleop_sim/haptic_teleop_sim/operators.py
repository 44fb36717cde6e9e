"""The operator's hand on the master: a passive impedance that holds a posture or moves along via points.

    torque of the hand on a joint = stiffness (target - phi) + damping (target' - phi') - inertia phi''

It holds the axes of the Omni, or pushes the arms of the 2DSFJ.

The part that depends on the axis becomes part of the plant (`Operator.grip`): inside the dynamics, where a
spring and a damper can only dissipate, whatever the sampling time. What is left is `Operator.torques`, a
function of time alone. Of one hand the three axes are taken as independent.

Between via points the hand moves with minimum jerk, from rest to rest (Flash and Hogan, J. Neurosci. 5, 1985,
1688-1703).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.compiled import njit
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.parameters import Parameter
from haptic_teleop_control.quantities import check_quantities, from_parameters, parameters_of, quantity
from haptic_teleop_control.robots import OMNI_JOINTS

from .joint_hardware import JointHardware
from .model import Effect, Model

Array = NDArray[np.float64]
MODES = ("none", "hold", "trajectory")


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


def operator_parameters(joints: Sequence[str], hand: Hand) -> list[Parameter]:
    """Parameters of an operator with a hand on each of `joints`, `hand` by default."""
    what = "none: nobody holds the device; hold: at the posture; trajectory: along the via points"
    return [
        Parameter("operator.mode", "none", choices=MODES, meaning=what),
        *(p for joint in joints for p in parameters_of(hand, f"{joint}.hand.", runtime=False)),
    ]


OPERATOR_PARAMETERS = operator_parameters(OMNI_JOINTS, Hand())
"""Parameters of the operator of the Omni; part of OMNI_PARAMETERS."""


@dataclass(frozen=True)
class Operator:
    """Who holds the device: a mode of MODES, and the hand on each joint."""

    mode: str = "none"
    hands: tuple[Hand, ...] = field(default_factory=lambda: tuple(Hand() for _ in OMNI_JOINTS))

    def __post_init__(self) -> None:
        if self.mode not in MODES:
            raise ConfigurationError(f"operator.mode is {self.mode!r}; choose {' | '.join(MODES)}.")

    @classmethod
    def from_parameters(
        cls, values: Mapping[str, Any], source: str = "parameters", joints: Sequence[str] = OMNI_JOINTS
    ) -> Self:
        """From flat parameters; ConfigurationError names source, key and remedy."""
        hands = []
        for axis in joints:
            try:
                hands.append(from_parameters(Hand, values, f"{axis}.hand."))
            except ConfigurationError as error:
                raise ConfigurationError(f"{source}: {axis}.{error}") from error
        return cls(values["operator.mode"], tuple(hands))

    def grip(self, axes: Sequence[JointHardware]) -> tuple[JointHardware, ...]:
        """The axes with the hand's inertia, damping and stiffness (about zero) in their plants."""
        if self.mode == "none":
            return tuple(axes)
        return tuple(
            replace(axis, model=grip_model(axis.model, hand))
            for axis, hand in zip(axes, self.hands, strict=True)
        )

    def torques(self, t: Array) -> Array:
        """(time, axes), N·m, that the hand adds at the times t, s, to its impedance about zero."""
        return hand_torques(t, *self._numbers())

    @lru_cache(maxsize=16)  # noqa: B019 (operators are small, few, and live as long as the program)
    def _numbers(self) -> tuple[Array, Array]:
        """What `hand_torques` takes: (axes, 2) stiffness and damping, (axes, points, 2) times and angles."""
        held = [((0.0, hand.posture),) for hand in self.hands]
        moving = [tuple(zip(hand.times, hand.angles, strict=True)) for hand in self.hands]
        points = moving if self.mode == "trajectory" else held
        impedance = np.array([(hand.stiffness, hand.damping) for hand in self.hands])
        longest = max(map(len, points))
        # The last point is repeated: a piece of no length after the end is never entered.
        table = np.array([p + (p[-1],) * (longest - len(p)) for p in points])
        return impedance * (self.mode != "none"), table


@njit(cache=True)
def hand_torques(t, impedance, points):  # type: ignore[no-untyped-def]
    """Torques (time, axes) of hands at the times t (time,); arguments as `Operator._numbers` gives them."""
    torques = np.empty((t.shape[0], impedance.shape[0]))
    last = points.shape[1] - 1
    for k in range(t.shape[0]):
        for i in range(impedance.shape[0]):
            piece = 0
            while (
                piece < last
                and points[i, piece + 1, 0] <= t[k]
                and points[i, piece, 0] < points[i, piece + 1, 0]
            ):
                piece += 1
            angle, rate = points[i, piece, 1], 0.0
            if piece < last and t[k] > points[i, piece, 0] and points[i, piece + 1, 0] > points[i, piece, 0]:
                span = points[i, piece + 1, 0] - points[i, piece, 0]
                way = points[i, piece + 1, 1] - points[i, piece, 1]
                s = (t[k] - points[i, piece, 0]) / span
                angle += way * s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
                rate = way / span * 30.0 * (s * (1.0 - s)) ** 2
            torques[k, i] = impedance[i, 0] * angle + impedance[i, 1] * rate
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
