"""The simulated Phantom Omni: three axes with encoders and a torque limit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Self

import numpy as np
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.filters import VelocityFilter
from haptic_teleop_control.parameters import Parameter, ParameterTable
from haptic_teleop_control.quantities import check_quantities, from_parameters, parameters_of, quantity
from haptic_teleop_control.robots import OMNI_JOINTS, OMNI_PEAK_TORQUE, OMNI_RATE_HZ, OMNI_RESOLUTION
from numpy.typing import ArrayLike, NDArray

from .default_models import omni_axis_model
from .model import Model
from .model_choice import choose_model
from .plant import Plant
from .step_result import StepResult

Array = NDArray[np.float64]


@dataclass(frozen=True)
class OmniAxisSettings:
    """One axis: its plant, encoder and torque limit. Raises ConfigurationError naming the field for a value
    outside its range."""

    model: Model
    resolution: float = quantity(OMNI_RESOLUTION, "rad", "per count of the encoder; 0: none", minimum=0.0)
    torque_limit: float = quantity(OMNI_PEAK_TORQUE, "N·m", "largest torque that the motor gives", above=0.0)
    initial_angle: float = quantity(0.0, "rad", "angle at the start", minimum=-1.6, maximum=1.6)

    def __post_init__(self) -> None:
        check_quantities(self)


def _default(axis: str) -> OmniAxisSettings:
    return OmniAxisSettings(omni_axis_model(axis))


def _table() -> ParameterTable:
    found = [
        Parameter("rate", OMNI_RATE_HZ, "Hz", 10.0, 10_000.0, meaning="samples per second"),
        Parameter("timeout", 0.05, "s", 0.005, 0.2, meaning="age of a command at which the torque goes to zero"),
        Parameter("seed", 1, minimum=0, meaning="seed of the operator's tremor"),
    ]
    for axis in OMNI_JOINTS:
        found.append(Parameter(
            f"{axis}.model", "", meaning="model file of the plant, relative to the parameter file; empty: built-in",
        ))
        found += parameters_of(_default(axis), f"{axis}.", runtime=False)
    return ParameterTable("omni_sim", found)


OMNI_PARAMETERS = _table()
"""Parameters of the simulated Omni: those of a node `omni_sim`, and of the lockstep runner."""


@dataclass(frozen=True)
class OmniSettings:
    """The three axes. Raises ConfigurationError when a model belongs to another joint."""

    omni_x: OmniAxisSettings = field(default_factory=lambda: _default("omni_x"))
    omni_y: OmniAxisSettings = field(default_factory=lambda: _default("omni_y"))
    omni_z: OmniAxisSettings = field(default_factory=lambda: _default("omni_z"))

    def __post_init__(self) -> None:
        for axis in fields(self):
            model = getattr(self, axis.name).model
            if model.joint != axis.name:
                raise ConfigurationError(
                    f"{model.source}: this is a model of {model.joint}; give {axis.name} one of its own."
                )

    @classmethod
    def from_parameters(
        cls, values: Mapping[str, Any], folder: str | Path | None = None, source: str = "parameters"
    ) -> Self:
        """From flat parameters (checked against OMNI_PARAMETERS); model files are looked for in `folder` first."""
        checked = OMNI_PARAMETERS.check(values, source)
        axes = []
        for axis in OMNI_JOINTS:
            model = choose_model(axis, checked[f"{axis}.model"], omni_axis_model, folder, source)
            axes.append(from_parameters(OmniAxisSettings, checked, f"{axis}.", model=model))
        return cls(*axes)


class OmniRobot:
    """The Omni in motion. Order of one sample: `sense`, then `step` with the torque that acts until the next
    `sense`. dt: s. time: s."""

    names = OMNI_JOINTS

    def __init__(self, settings: OmniSettings | None = None, dt: float = 1.0 / OMNI_RATE_HZ, seed: int = 1) -> None:
        self.settings = settings = OmniSettings() if settings is None else settings
        self.dt = float(dt)
        self._axes = (settings.omni_x, settings.omni_y, settings.omni_z)
        self.plants = tuple(Plant(axis.model, dt) for axis in self._axes)
        self._filter = VelocityFilter(3, dt)
        self.reset()

    @classmethod
    def from_parameters(
        cls, values: Mapping[str, Any], dt: float | None = None, folder: str | Path | None = None,
        source: str = "parameters",
    ) -> Self:
        """The robot that parameters describe (OMNI_PARAMETERS); dt defaults to 1/`rate`."""
        checked = OMNI_PARAMETERS.check(values, source)
        step = 1.0 / checked["rate"] if dt is None else dt
        return cls(OmniSettings.from_parameters(checked, folder, source), step, checked["seed"])

    def reset(self) -> None:
        """Every axis at rest at its initial angle, no torque."""
        start = np.array([axis.initial_angle for axis in self._axes])
        for plant, angle in zip(self.plants, start, strict=True):
            plant.reset((angle, angle, 0.0, 0.0))
        self.torque = np.zeros(3)
        self._filter.reset(start)

    @property
    def time(self) -> float:
        return self.plants[0].time

    def sense(self) -> tuple[Array, Array, Array]:
        """Position (3,), rad, velocity (3,), rad/s, and effort (3,), N·m: the torque applied last.

        Call it once per sample: the velocity filter moves on.
        """
        position = np.empty(3)
        for i, (axis, plant) in enumerate(zip(self._axes, self.plants, strict=True)):
            angle = plant.readings()[0]
            position[i] = round(angle / axis.resolution) * axis.resolution if axis.resolution > 0.0 else angle
        return position, self._filter.step(position), self.torque.copy()

    def step(self, effort_command: ArrayLike, operator_torque: ArrayLike = (0.0, 0.0, 0.0)) -> StepResult:
        """One sample with `effort_command` (3,), N·m, at the motors and `operator_torque` (3,), N·m, of the hand."""
        result = StepResult.OK
        efforts = np.asarray(effort_command, dtype=np.float64)
        hand = np.asarray(operator_torque, dtype=np.float64)
        for i, (axis, plant) in enumerate(zip(self._axes, self.plants, strict=True)):
            torque = float(efforts[i])
            if not math.isfinite(torque):
                torque = 0.0
                result |= StepResult.REFUSED_COMMAND
            if abs(torque) > axis.torque_limit:
                torque = math.copysign(axis.torque_limit, torque)
                result |= StepResult.LIMITED
            self.torque[i] = torque
            plant.step(torque, external_torque=float(hand[i]) if math.isfinite(hand[i]) else 0.0)
            if not plant.finite:
                plant.reset()
                result |= StepResult.DIVERGED
        return result
