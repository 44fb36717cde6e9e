"""The simulated 2DSFJ as an MJCF text: for each stage two hinges with absolute angles, and a tendon as the
spring between them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .mujoco_effects import StageWords

GRAVITY = 9.81

Attributes = dict[str, str]


def mjcf(stages: Mapping[str, StageWords], timestep: float) -> str:
    """The whole robot as an MJCF text, every stage with hinges `<stage>_motor` and `<stage>_arm`, angles
    absolute, CCW positive; timestep in s.
    """
    bodies, tendons, actuators = "", "", ""
    for stage, words in stages.items():
        p, hinges = words.model.parameters, []
        for part, own in (("motor", words.motor), ("arm", words.arm)):
            hinges.append({"name": f"{stage}_{part}", "axis": "0 1 0", **own})
        bodies += f"<body>{tag('joint', hinges[0])}{inertial(p['motor_inertia'])}</body>"
        arm = inertial(p["arm_inertia"], *words.mass)
        bodies += f"<body>{tag('joint', hinges[1])}{arm}{words.mode}</body>"
        ends = f'<joint joint="{stage}_motor" coef="1"/><joint joint="{stage}_arm" coef="-1"/>'
        tendons += f"<fixed {xml_words(words.spring)}>{ends}</fixed>"
        actuators += tag("general", {"joint": f"{stage}_motor", **words.actuator})
    return (
        f'<mujoco><compiler angle="radian"/><option timestep="{timestep:.9g}" integrator="implicitfast" '
        f'gravity="0 0 -{GRAVITY}"><flag autoreset="disable"/></option><default><joint '
        'solreffriction="0.001 1" solimpfriction="0.99 0.999 0.001"/></default>'
        f"<worldbody>{bodies}</worldbody><tendon>{tendons}</tendon><actuator>{actuators}</actuator></mujoco>"
    )


def inertial(about_axis: float, mass: float = 1.0, length: float = 0.0, angle: float = 0.0) -> str:
    """An element with moment of inertia `about_axis`, kg·m², whose `mass`, kg, hangs at `length`, m, off the
    axis, `angle`, rad, from straight down."""
    own = number(about_axis - mass * length**2)
    place = f"{number(-length * math.sin(angle))} 0 {number(-length * math.cos(angle))}"
    return tag("inertial", {"pos": place, "mass": number(mass), "diaginertia": f"{own} {own} {own}"})


def tag(name: str, attributes: Attributes) -> str:
    """An element without content."""
    return f"<{name} {xml_words(attributes)}/>"


def xml_words(attributes: Attributes) -> str:
    """Attributes as they stand in an element."""
    return " ".join(f'{name}="{value}"' for name, value in attributes.items())


def number(value: float) -> str:
    """A number with twelve digits."""
    return f"{value:.12g}"
