"""Torques that depend on the angle: gravity, springs, ripple, stops; and a constant one."""

from __future__ import annotations

import math

from .entry import EffectEntry
from .hypothesis import CHANGES, SMALL_TORQUE, Equivalent, Numbers, Recorded, noticeable, repeats, seen_once
from .parameter import EffectParameter

#: Share of the travel by which the recordings' torque, rms, pushes into a stop at most: what yields further
#: stops nothing, it is a spring; by hand.
_YIELDS = 0.3
#: Cycles per revolution about one that are those of gravity: they say the same, but for a shape hardly
#: seen; by hand.
_ONCE_A_TURN = 0.15
#: A pull towards an angle: gravity or a spring.
_PULL = ("pull towards an angle",)
_SMALL_ANGLES = "over a small angle"
_HARDLY_MOVING = "where the angle hardly changes"
_AT_REST = "where the deflection hardly changes, with a preload of the joint"
_BOTH = ("motor", "arm")


def _as_spring(p: Numbers) -> dict[str, float]:
    """Gravity over small angles, as a spring: it hangs, it does not stand."""
    if math.cos(p["phase"]) <= 0.1:
        return {}
    return {"stiffness": p["torque"] * math.cos(p["phase"]), "rest": -math.tan(p["phase"])}


def _as_gravity(p: Numbers) -> dict[str, float]:
    """A spring over small angles, as gravity: T sin(q + phase) is k (q - rest)."""
    return {"torque": p["stiffness"] * math.hypot(1.0, p["rest"]), "phase": math.atan(-p["rest"])}


def _as_gravity_aside(p: Numbers) -> dict[str, float]:
    """A constant torque as gravity whose arm lies level."""
    return {"torque": abs(p["torque"]), "phase": -math.copysign(math.pi / 2.0, p["torque"])}


def _ripples(p: Numbers, on: Recorded) -> bool:
    """A noticeable amplitude, of a sine of which enough was seen; once a turn it is gravity."""
    noticed = p["amplitude"] > SMALL_TORQUE * on.size["torque"] and repeats(p, on)
    return noticed and abs(p["order"] - 1.0) > _ONCE_A_TURN


def _stops(p: Numbers, on: Recorded) -> bool:
    """The motion reaches it, and it is hard enough to stop anything."""
    reach = on.highest if p["angle"] > 0 else on.lowest
    return (
        abs(reach) > abs(p["angle"])
        and reach * p["angle"] > 0
        and p["stiffness"] * _YIELDS * on.span > on.size["torque"]
    )


def _pulls_to_an_angle(p: Numbers, on: Recorded) -> bool:
    """Over the travel its torque changes: with a rest far away it is a constant torque."""
    farthest = max(abs(on.lowest - p["rest"]), abs(on.highest - p["rest"]))
    return on.span > CHANGES * farthest


GRAVITY = EffectEntry(
    name="gravity",
    kind="torque",
    where=("motor", "arm"),
    motor_of_rigid_body=True,
    parameters=(
        EffectParameter(
            "torque",
            "N*m",
            "mass x gravity x distance of the centre of mass",
            minimum=0.0,
            typical=0.3,
            scale="torque",
        ),
        EffectParameter(
            "phase",
            "rad",
            "angle of the centre of mass from hanging straight down, at zero position",
            minimum=-6.3,
            maximum=6.3,
            typical=0.2,
            default=0.0,
            neutral=None,
            turns="phase",
        ),
    ),
    sentence="gravity pulls at the centre of mass",
    equation=lambda s, p: -p.torque * s.sin(s.position + p.phase),
    rate=lambda p, ks: (abs(p["torque"]), 0.0),
    spring=lambda p: p["torque"] * math.cos(p["phase"]),
    condition="{q}",
    follows="angle",
    separated=(("spring_to_ground", "move farther than recorded (60 degrees at least), or rotate the base"),),
    practical=noticeable("torque"),
    families=_PULL,
    equivalents=(Equivalent("spring_to_ground", _BOTH, _as_spring, condition=_SMALL_ANGLES),),
    large=True,
    at_rest=lambda p: -p["torque"] * math.sin(p["phase"]),
    companion="joint_preload",
)

SPRING_TO_GROUND = EffectEntry(
    name="spring_to_ground",
    kind="torque",
    where=("motor", "arm"),
    parameters=(
        EffectParameter(
            "stiffness",
            "N*m/rad",
            "stiffness against the ground",
            typical=0.1,
            scale="stiffness",
            minimum=0.0,
        ),
        EffectParameter(
            "rest",
            "rad",
            "angle without torque",
            typical=0.1,
            default=0.0,
            neutral=None,
            scale="angle",
            turns="offset",
        ),
    ),
    sentence="a spring, or a stiff cable, pulls towards one angle",
    equation=lambda s, p: -p.stiffness * (s.position - p.rest),
    rate=lambda p, ks: (abs(p["stiffness"]), 0.0),
    spring=lambda p: p["stiffness"],
    condition="{q}",
    follows="angle",
    practical=_pulls_to_an_angle,
    families=_PULL,
    equivalents=(
        Equivalent("spring_to_ground", _BOTH, across=True, condition=_AT_REST),
        Equivalent("gravity", ("arm",), _as_gravity, condition=_SMALL_ANGLES),
    ),
    large=True,
    at_rest=lambda p: p["stiffness"] * p["rest"],
    companion="joint_preload",
)

CONSTANT_TORQUE = EffectEntry(
    name="constant_torque",
    kind="torque",
    where=("motor", "arm"),
    parameters=(
        EffectParameter("torque", "N*m", "torque in the positive direction", typical=0.1, scale="torque"),
    ),
    sentence="a constant torque acts, in one direction (at a motor like an offset of the recorded input)",
    equation=lambda s, p: p.torque,
    condition="always",
    practical=noticeable("torque"),
    equivalents=(
        Equivalent("constant_torque", _BOTH, across=True, condition=_AT_REST),
        Equivalent("gravity", ("arm",), _as_gravity_aside, condition=_HARDLY_MOVING),
    ),
    large=True,
    at_rest=lambda p: p["torque"],
    companion="joint_preload",
)

TORQUE_RIPPLE = EffectEntry(
    name="torque_ripple",
    kind="torque",
    where=("motor",),
    parameters=(
        EffectParameter(
            "amplitude", "N*m", "amplitude of the ripple", minimum=0.0, typical=0.15, scale="torque"
        ),
        EffectParameter(
            "order",
            "cycles/rev",
            "cycles per revolution of the output",
            minimum=0.1,
            maximum=1000.0,
            typical=8.0,
            grid=(2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 14, 16, 18, 20, 24, 28, 32, 40),
            neutral=None,
            scan="order",
        ),
        EffectParameter(
            "phase", "rad", "phase at zero angle", typical=0.5, default=0.0, neutral=None, turns="phase"
        ),
    ),
    sentence="the motor torque varies periodically with its angle (cogging, gear mesh)",
    equation=lambda s, p: p.amplitude * s.sin(p.order * s.position + p.phase),
    rate=lambda p, ks: (abs(p["amplitude"] * p["order"]), 0.0),
    needs="travel over six tenths of a cycle: less is one hill or valley, as gravity has it",
    condition="{q}, periodically",
    follows="angle",
    practical=_ripples,
    doubtful=seen_once,
)


def by_sphere(s, p):
    """The same contact with the force of a sphere on a plane, which goes with the penetration to the 3/2
    (Hertz; Hunt and Crossley, J. Applied Mechanics 42, 1975)."""

    def push(side):
        depth = s.positive_part(side * s.position - s.abs(p.angle))
        return depth**1.5 * side * s.positive_part(1 + p.dissipation * side * s.velocity)

    return -p.stiffness * (push(s.side(p.angle)) + p.both_sides * push(-s.side(p.angle)))


HARD_STOP = EffectEntry(
    name="hard_stop",
    kind="torque",
    where=("arm", "motor"),
    momentary=True,
    parameters=(
        EffectParameter(
            "angle",
            "rad",
            "angle of the stop; its sign says on which side the stop lies",
            typical=0.9,
            scale="furthest",
            grid=(0.97, 0.9, 0.75),
            neutral=None,
            scan="furthest",
        ),
        EffectParameter(
            "stiffness", "N*m/rad", "stiffness of the stop", minimum=0.0, typical=5.0, scale="stiffness"
        ),
        EffectParameter(
            "dissipation",
            "s/rad",
            "damping in contact per stiffness and penetration rate (Hunt and Crossley)",
            minimum=0.0,
            maximum=10.0,
            default=0.0,
            scale="one",
            grid=(3.0,),
        ),
        EffectParameter(
            "both_sides",
            "(1: yes, 0: no)",
            "a second stop at the opposite angle",
            minimum=0.0,
            maximum=1.0,
            default=0.0,
            neutral=None,
        ),
    ),
    sentence="the motion runs into a compliant stop or wall",
    # The factor of the rate is held positive: a wall pushes, it does not pull.
    equation=lambda s, p: (
        -p.stiffness
        * (
            s.positive_part(s.side(p.angle) * s.position - s.abs(p.angle))
            * s.side(p.angle)
            * s.positive_part(1 + p.dissipation * s.side(p.angle) * s.velocity)
            - p.both_sides
            * s.positive_part(-s.side(p.angle) * s.position - s.abs(p.angle))
            * s.side(p.angle)
            * s.positive_part(1 - p.dissipation * s.side(p.angle) * s.velocity)
        )
    ),
    other_forms=(by_sphere,),
    # Penetration of 0.02 rad: 2 rad/s against 20 N*m/rad with 2 g*m^2; stiffer stops give way less.
    rate=lambda p, ks: (abs(p["stiffness"]), 0.02 * abs(p["stiffness"]) * p["dissipation"]),
    condition="{q} at the stop",
    follows="angle",
    practical=_stops,
    large=True,
)

ENTRIES = (GRAVITY, SPRING_TO_GROUND, CONSTANT_TORQUE, TORQUE_RIPPLE, HARD_STOP)
