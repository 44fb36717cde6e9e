"""The simulated Phantom Omni: three axes with encoders and a torque limit, free or in the operator's hand."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from haptic_teleop_control.omni_compensation import COMPENSATION, OmniCompensation
from haptic_teleop_control.parameters import Parameter, ParameterTable
from haptic_teleop_control.quantities import from_parameters, parameters_of, quantity
from haptic_teleop_control.robots import OMNI_JOINTS, OMNI_PEAK_TORQUE, OMNI_RATE_HZ, OMNI_RESOLUTION

from .default_models import omni_axis_model
from .joint_hardware import JointHardware
from .model import Effect, Model
from .model_choice import check_joint, choose_model
from .operators import OPERATOR_PARAMETERS, Operator
from .robot import Robot
from .step_result import StepResult

Array = NDArray[np.float64]
_OWN = ("current_limit", "drive_resolution", "disturbance.rms", "disturbance.cutoff_hz", "initial_angle")
"""Of the parameters of JointHardware those that the Omni has: it takes torques and has no current sense."""
_NAMES = {"current_limit": "torque_limit", "drive_resolution": "resolution"}


def axis_hardware(axis: str, model: Model | None = None, **changes: float) -> JointHardware:
    """The facts of `axis`, e.g. "omni_y", around `model` (built-in by default), and `changes` to them."""
    values = {"command_limit": OMNI_PEAK_TORQUE, "drive_resolution": OMNI_RESOLUTION}
    return JointHardware(omni_axis_model(axis) if model is None else model, **{**values, **changes})


@dataclass(frozen=True)
class Surfaces:
    """Hard surfaces either side of an axis, in place of its end stops: a `hard_stop` of its model."""

    angle: float = quantity(
        math.inf,
        "rad",
        "hard surfaces at plus and minus this angle, in place of the end stops; .inf: none",
        name="wall.angle",
        above=0.0,
        infinite=True,
    )
    stiffness: float = quantity(
        200.0, "N·m/rad", "stiffness of the surfaces", name="wall.stiffness", above=0.0
    )
    dissipation: float = quantity(
        1.0,
        "s/rad",
        "damping of the surfaces (Hunt and Crossley)",
        name="wall.dissipation",
        minimum=0.0,
        maximum=10.0,
    )

    def apply(self, model: Model) -> Model:
        """`model` with these surfaces; itself where there are none."""
        if not math.isfinite(self.angle):
            return model
        location = model.location("motor")
        stop = {
            "angle": self.angle,
            "stiffness": self.stiffness,
            "dissipation": self.dissipation,
            "both_sides": 1.0,
        }
        others = tuple(e for e in model.effects if (e.effect, e.location) != ("hard_stop", location))
        return replace(model, effects=(*others, Effect("hard_stop", location, stop)))


def _axis_parameters(axis: str) -> list[Parameter]:
    found = []
    for parameter in parameters_of(axis_hardware(axis), "", runtime=False):
        if parameter.name in _OWN:
            unit = parameter.unit.replace("A", "N·m")
            name = f"{axis}.{_NAMES.get(parameter.name, parameter.name)}"
            meaning = parameter.meaning.replace("current that the amplifier", "torque that the motor")
            found.append(
                Parameter(
                    name,
                    parameter.default,
                    unit,
                    parameter.minimum,
                    parameter.maximum,
                    meaning=meaning,
                    above=parameter.above,
                    infinite=parameter.infinite,
                )
            )
    return found


def _table() -> ParameterTable:
    found = [
        Parameter("rate", OMNI_RATE_HZ, "Hz", 10.0, 10_000.0, meaning="samples per second"),
        Parameter(
            "timeout", 0.05, "s", 0.005, 0.2, meaning="age of a command at which the torque goes to zero"
        ),
        Parameter("seed", 1, minimum=0, meaning="seed of the random torques"),
        *OPERATOR_PARAMETERS,
        *COMPENSATION,
    ]
    for axis in OMNI_JOINTS:
        found.append(
            Parameter(
                f"{axis}.model",
                "",
                meaning="model file of the plant, relative to the parameter file; empty: built-in",
            )
        )
        found += _axis_parameters(axis)
        found += parameters_of(Surfaces(), f"{axis}.", runtime=False)
    return ParameterTable("omni_sim", found)


OMNI_PARAMETERS = _table()
"""Parameters of the simulated Omni: those of the node `omni_sim`, and of the lockstep runner."""


@dataclass(frozen=True)
class OmniSettings:
    """The three axes and who holds them. Raises ModelError when a model belongs to another joint."""

    omni_x: JointHardware = field(default_factory=lambda: axis_hardware("omni_x"))
    omni_y: JointHardware = field(default_factory=lambda: axis_hardware("omni_y"))
    omni_z: JointHardware = field(default_factory=lambda: axis_hardware("omni_z"))
    operator: Operator = field(default_factory=Operator)

    def __post_init__(self) -> None:
        for axis in OMNI_JOINTS:
            check_joint(getattr(self, axis).model, axis)

    @classmethod
    def from_parameters(
        cls,
        values: Mapping[str, Any],
        folder: str | Path | None = None,
        source: str = "parameters",
        models: Mapping[str, str] | None = None,
    ) -> Self:
        """From flat parameters (checked against OMNI_PARAMETERS); model files are looked for in `folder`
        first. models: path -> text of model files that need not be there.

        Raises ConfigurationError or ModelError naming file, key and remedy.
        """
        checked = OMNI_PARAMETERS.check(values, source)
        axes = []
        for axis in OMNI_JOINTS:
            model = choose_model(axis, checked[f"{axis}.model"], omni_axis_model, folder, source, models)
            model = from_parameters(Surfaces, checked, f"{axis}.").apply(model)
            renamed = {f"{axis}.{name}": checked[f"{axis}.{_NAMES.get(name, name)}"] for name in _OWN}
            axes.append(from_parameters(JointHardware, renamed, f"{axis}.", model=model))
        return cls(*axes, operator=Operator.from_parameters(checked, source))


class OmniRobot(Robot):
    """The Omni in motion, with its operator's hand on it. Efforts are the torques applied last, compensation
    included; commands and signals are (3,).

    compensation: of the horizontal device, or None; `from_parameters` sets it. A device whose driver
    compensates, such as the emulated one, has none of its own.
    """

    namespace = "/omni"
    names = OMNI_JOINTS
    motors = OMNI_JOINTS
    encoders = 1

    def __init__(
        self, settings: OmniSettings | None = None, dt: float = 1.0 / OMNI_RATE_HZ, seed: int = 1
    ) -> None:
        self.settings = settings = OmniSettings() if settings is None else settings
        self.compensation: OmniCompensation | None = None
        axes = (settings.omni_x, settings.omni_y, settings.omni_z)
        super().__init__(axes, dt, seed, settings.operator)

    @classmethod
    def from_parameters(
        cls,
        values: Mapping[str, Any],
        dt: float | None = None,
        folder: str | Path | None = None,
        source: str = "parameters",
        models: Mapping[str, str] | None = None,
    ) -> Self:
        """The robot that parameters describe (OMNI_PARAMETERS); dt, s, defaults to 1/`rate`."""
        checked = OMNI_PARAMETERS.check(values, source)
        step = 1.0 / checked["rate"] if dt is None else dt
        robot = cls(OmniSettings.from_parameters(checked, folder, source, models), step, checked["seed"])
        compensation = OmniCompensation.from_parameters(checked, source)
        if compensation.settings.active:
            robot.compensation = compensation
        return robot

    def step(self, effort_command: ArrayLike, external_torque: ArrayLike | None = None) -> StepResult:
        """As `Robot.step`, with the device's own compensation on top of the command while it is powered."""
        if self.compensation is not None:
            if self.powered:
                added = self.compensation.step(self._out[0], self._out[1], self.dt)
                effort_command = np.asarray(effort_command, dtype=np.float64) + added
            else:
                self.compensation.rest()
        return super().step(effort_command, external_torque)
