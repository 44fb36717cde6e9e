"""Simulated robots behind emulated devices: raw angles and currents, without the hardware's quantisation.

What the simulated plants add around the joints - converters, counters, limits, filters - the emulated device
and the driver do here. The drivers find these factories by name, `haptic_teleop_sim.emulation:sfj_plant`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.node_tables import without_node_parameters
from haptic_teleop_control.parameter_files import load_parameter_file, parameters_for
from haptic_teleop_control.parameters import ParameterTable

from .hardware import OMNI_PARAMETERS, SFJ_PARAMETERS, OmniRobot, OmniSettings, SfjRobot, SfjSettings
from .joint_hardware import JointHardware
from .robot import Robot

Array = NDArray[np.float64]


def sfj_plant(file: str, rate: float) -> SfjConnectors:
    """The 2DSFJ that the section `sfj_sim` of the parameter file describes; defaults when `file` is empty.

    rate: samples per second of the emulated device. Raises ConfigurationError or ModelError.
    """
    values, folder, source = _section(file, "sfj_sim", SFJ_PARAMETERS)
    settings = SfjSettings.from_parameters(values, folder, source)
    bare = replace(settings, stage1=_bare(settings.stage1), stage2=_bare(settings.stage2))
    return SfjConnectors(_compiled(lambda: SfjRobot(bare, 1.0 / rate, values["seed"])))


def omni_plant(file: str, rate: float) -> OmniConnectors:
    """The Omni, in its operator's hand, that the section `omni_sim` describes; otherwise as `sfj_plant`."""
    values, folder, source = _section(file, "omni_sim", OMNI_PARAMETERS)
    settings = OmniSettings.from_parameters(values, folder, source)
    axes = {name: _bare(getattr(settings, name)) for name in OmniRobot.names}
    whole = replace(settings, **axes)
    return OmniConnectors(_compiled(lambda: OmniRobot(whole, 1.0 / rate, values["seed"])))


class _Connectors:
    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self._constants = robot.torque_constants

    def advance(self, command: Array) -> None:
        """One sample with `command`: A for the 2DSFJ, N·m, beside the operator's torque, for the Omni."""
        self.robot.step(command * self._constants)


class SfjConnectors(_Connectors):
    """The 2DSFJ as a board sees it."""

    def sense(self) -> tuple[Array, Array]:
        """Angles (4,), rad, and currents (2,), A, with the offset and noise of their sensors."""
        position, _, effort = self.robot.sense()
        return position, effort[0::2] / self._constants


class OmniConnectors(_Connectors):
    """The Omni as its electronics see it."""

    def sense(self) -> Array:
        """Angles (3,), rad, about the neutral position."""
        return self.robot.sense()[0]


def _compiled(make: Callable[[], Robot]) -> Robot:
    """A robot in its initial state whose functions have compiled: in a driver's loop it would be too late."""
    first = make()
    first.sense()
    first.step(np.zeros(len(first.torque_constants)))
    return make()


def _bare(joint: JointHardware) -> JointHardware:
    """`joint` without converters and limits: those are the device's."""
    return replace(
        joint,
        command_limit=math.inf,
        command_resolution=0.0,
        drive_resolution=0.0,
        joint_resolution=0.0,
        sense_resolution=0.0,
    )


def _section(file: str, node: str, table: ParameterTable) -> tuple[dict[str, Any], Path | None, str]:
    stated: Mapping[str, Any] = {}
    if file:
        sections = load_parameter_file(file)
        stated = {key: value for key, value in parameters_for(sections, node, table).items() if key in table}
        own = {name: values for name, values in sections.items() if "*" not in name}
        # Keys of the section itself are checked; what a wildcard says to others does not concern the plant.
        unknown = without_node_parameters(parameters_for(own, node))
        table.check(unknown, file)
    source = file or "parameters"
    return table.check(stated, source), Path(file).parent if file else None, source
