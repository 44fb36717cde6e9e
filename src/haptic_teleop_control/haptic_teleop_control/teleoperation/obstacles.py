"""Why master and slave cannot be coupled, in words: what is the matter, and what to do."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.robots import STAGES
from haptic_teleop_control.teleoperation.sides import REFERENCES
from haptic_teleop_control.teleoperation.streams import Stream

Array = NDArray[np.float64]

PATTERN_RUNS = "a pattern runs, and the robot would move at once: stop it first: haptic-teleop operate stop"


def not_heard(stream: Stream, now: int) -> str:
    """A stream that is needed brings nothing that can be used. now: ns."""
    if stream.refused:
        return f"{stream.name} cannot be used: {stream.refused}"
    if stream.at is None:
        return f"waiting for {stream.name}"
    return f"{stream.name} is silent for {stream.silence(now):.3f} s"


def other_command(master: str) -> str:
    """What to command the robot `master`, "omni" or "sfj", with instead."""
    joints, field = REFERENCES[master]
    return (
        f"the {master} as master takes the {field} of {' and '.join(joints)}: start a signal "
        f"generator with `kind: {field}`, or set `command_source: device` and let a hand lead"
    )


def in_faults(robot_faults: Mapping[str, str]) -> str:
    """Robots have faults of their own: node -> its sentence."""
    told = " and ".join(f"{node} is in a fault ({why})" for node, why in robot_faults.items())
    reset = "haptic-teleop operate reset --controller"
    resets = " and ".join(f"`{reset} {node}`" for node in robot_faults)
    return f"{told}; see to that, then {resets}"


def not_neutral(offset: Array, allowed: float, commander: str) -> str | None:
    """What commands is away from the neutral position, offset (stages,) rad, by more than `allowed` rad; else
    None."""
    worst = int(np.argmax(np.abs(offset)))
    if abs(offset[worst]) <= allowed:
        return None
    return (
        f"{commander} of {STAGES[worst]} is {offset[worst]:+.3f} rad from neutral, more than "
        f"{allowed:.3f} rad"
    )


def moving(velocity: Array, allowed: float) -> str | None:
    """The slave moves, velocity (stages,) rad/s, faster than `allowed` rad/s; else None."""
    fastest = int(np.argmax(np.abs(velocity)))
    if abs(velocity[fastest]) <= allowed:
        return None
    return (
        f"the slave of {STAGES[fastest]} moves with {velocity[fastest]:+.2f} rad/s, more than "
        f"{allowed:.2f} rad/s"
    )


def slow_link(round_trip: float, allowed: float) -> str | None:
    """The link's round trip, s, takes longer than `allowed`, s; else None."""
    if not round_trip > allowed:
        return None
    return f"the link's round trip takes {1e3 * round_trip:.1f} ms, more than {1e3 * allowed:.1f} ms"
