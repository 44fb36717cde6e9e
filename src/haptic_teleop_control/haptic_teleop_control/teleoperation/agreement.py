"""What the nodes of one scenario have to state alike: time (`simulates`), roles, rates, artificial command.

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
VIRTUAL_DEVICES = ("emulated", "replay")
"""Devices of a driver that keep a clock which can be held."""


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
    for name, values in nodes.items():
        device = values.get("device", VIRTUAL_DEVICES[0])
        # In simulated time hardware is refused as such (`simulates`).
        real = device not in VIRTUAL_DEVICES and not values.get("use_sim_time")
        if control.get("auto_engage") and real:
            raise ConfigurationError(
                f"{source}: {CONTROLLER}: auto_engage is true, but {name} drives a robot (device: {device}). "
                "Coupling robots is an act of the operator; set auto_engage: false, and use operate engage."
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


def simulates(nodes: Mapping[str, Mapping[str, Any]], source: str) -> bool:
    """Whether these nodes run in simulated time.

    Raises ConfigurationError where some do and others do not, and where a driver would that moves hardware.
    """
    stating = {name: values for name, values in nodes.items() if "use_sim_time" in values}
    by_ticks = [name for name, values in stating.items() if values["use_sim_time"]]
    by_the_wall = [name for name in stating if name not in by_ticks]
    if by_ticks and by_the_wall:
        raise ConfigurationError(f"{source}: {_two_times(by_ticks[0], by_the_wall[0])}")
    simulated = bool(by_ticks)
    for name, values in nodes.items():
        device = values.get("device", VIRTUAL_DEVICES[0])
        if simulated and device not in VIRTUAL_DEVICES:
            raise ConfigurationError(f"{source}: {hardware_refusal(name, device)}")
    return simulated


def check_recorder(stated: Mapping[str, Any], simulated: bool, source: str) -> None:
    """stated: what the file says to the recorder, which takes the time of the run that it records.

    Raises ConfigurationError where it is to take another one.
    """
    if stated.get("use_sim_time", simulated) != simulated:
        both = ("the scenario", "recorder") if simulated else ("recorder", "the scenario")
        raise ConfigurationError(f"{source}: {_two_times(*both)}")


def _two_times(by_ticks: str, by_the_wall: str) -> str:
    return (
        f"{by_ticks} runs in simulated time and {by_the_wall} does not; set use_sim_time alike, once for all "
        "under `/**:`."
    )


def hardware_refusal(node: str, device: str) -> str:
    """Why a driver of hardware takes no simulated time."""
    return (
        f"{node}: use_sim_time is true, but device {device} is hardware, whose time nobody can hold; set "
        "use_sim_time: false, or device: emulated."
    )


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
