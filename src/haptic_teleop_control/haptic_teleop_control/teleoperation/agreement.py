"""What the nodes of one scenario have to state alike: roles, rates, and the artificial command.

A node alone cannot see it: a controller at another rate than its robot filters and integrates wrongly, and a
command of the wrong joints or kind is refused sample by sample. So it is looked at before anything starts.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.teleoperation.sides import REFERENCES

CONTROLLER, GENERATOR = "force_controller", "signal_generator"
ROBOTS = {"sfj": ("sfj_sim", "sfj_driver", "mujoco_sim"), "omni": ("omni_sim", "omni_driver")}
"""The nodes that may stand for a robot."""


def check_agreement(nodes: Mapping[str, Mapping[str, Any]], source: str) -> None:
    """nodes: all parameters of each node, by its bare name; those that are missing are not looked at.

    Raises ConfigurationError naming `source`, node, key and remedy.
    """
    control = nodes.get(CONTROLLER)
    if control is None:
        return
    if control["master"] == control["slave"]:
        raise ConfigurationError(
            f"{source}: {CONTROLLER}: master and slave are both {control['master']}; set one of them to "
            "the other robot."
        )
    for role in ("slave", "master"):
        for node in ROBOTS[control[role]]:
            if node in nodes and nodes[node]["rate"] != control[f"{role}_rate"]:
                raise ConfigurationError(
                    f"{source}: {CONTROLLER}: {role}_rate is {control[f'{role}_rate']:g} Hz, but {node} has "
                    f"a rate of {nodes[node]['rate']:g} Hz; make them equal."
                )
    if GENERATOR in nodes and control["command_source"] == "reference":
        _check_reference(control["master"], nodes[GENERATOR], source)


def _check_reference(master: str, signal: Mapping[str, Any], source: str) -> None:
    joints, kind = REFERENCES[master]
    if signal["kind"] != kind:
        raise ConfigurationError(
            f"{source}: {GENERATOR}: kind is {signal['kind']}; set kind: {kind} for the {master} as master."
        )
    if set(signal["joints"]) != set(joints):
        raise ConfigurationError(
            f"{source}: {GENERATOR}: joints are {list(signal['joints'])}; set joints: {list(joints)}."
        )
