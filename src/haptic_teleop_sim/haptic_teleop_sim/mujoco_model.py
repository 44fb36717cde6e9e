"""The simulated 2DSFJ as an MJCF text: for each stage two hinges with absolute angles, and a tendon as the
spring between them."""

from __future__ import annotations

from collections.abc import Mapping

from .mujoco_effects import StageWords
from .mujoco_xml import GRAVITY, inertial, tag, xml_words


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
