"""The simulated Quanser 2DSFJ: two plants, and around them encoders, amplifiers and current sense."""

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
from haptic_teleop_control.robots import SFJ_JOINTS, SFJ_RATE_HZ, SFJ_STAGES, STAGES
from numpy.typing import ArrayLike, NDArray

from .default_models import sfj_stage_model
from .model import Effect, Model
from .model_choice import add_effect, choose_model
from .plant import Plant
from .step_result import StepResult

Array = NDArray[np.float64]

#: 20 V over 2^12 steps of the analog output, at 0.5 A/V.
AMPLIFIER_RESOLUTION = 20.0 / 2**12 * 0.5
#: 20 V over 2^14 steps of the analog input, at 2 A/V.
SENSE_RESOLUTION = 20.0 / 2**14 * 2.0
#: A, measured on a 2DSFL with the amplifier that the 2DSFJ has: offsets between -9 and -23 mA.
SENSE_OFFSET = {"stage1": -0.015, "stage2": -0.02}
_NOISE_BLOCK = 1024


@dataclass(frozen=True)
class StageSettings:
    """One stage: its plant, and what the hardware does to command and readings.

    model: the plant, a model of this joint (see `Model`). Raises ConfigurationError naming the field for a value
    outside its range.
    """

    model: Model
    torque_constant: float = quantity(8.925, "N·m/A", "nominal effort per current, of the messages", above=0.0)
    stiffness: float = quantity(3.971, "N·m/rad", "nominal stiffness, for the effort of the arm", above=0.0)
    current_limit: float = quantity(0.94, "A", "largest current that the amplifier gives", above=0.0)
    drive_resolution: float = quantity(1.534e-5, "rad", "per count of the drive's encoder; 0: none", minimum=0.0)
    joint_resolution: float = quantity(2.462e-4, "rad", "per count of the joint's encoder; 0: none", minimum=0.0)
    amplifier_resolution: float = quantity(
        AMPLIFIER_RESOLUTION, "A", "per step of the analog output; 0: none", name="amplifier.resolution", minimum=0.0
    )
    sense_resolution: float = quantity(
        SENSE_RESOLUTION, "A", "per step of the analog input; 0: none", name="current_sense.resolution", minimum=0.0
    )
    sense_offset: float = quantity(0.0, "A", "error of the measured current", name="current_sense.offset")
    sense_noise: float = quantity(
        0.01, "A", "standard deviation of the measured current", name="current_sense.noise", minimum=0.0
    )
    disturbance_rms: float = quantity(
        0.0, "N·m", "random torque at the motor, root mean square", name="disturbance.rms", minimum=0.0
    )
    disturbance_cutoff_hz: float = quantity(
        5.0, "Hz", "bandwidth of that torque (first order)", name="disturbance.cutoff_hz", above=0.0
    )

    def __post_init__(self) -> None:
        check_quantities(self)

    @classmethod
    def for_stage(cls, stage: str, model: Model | None = None, **changes: float) -> StageSettings:
        """The facts of `stage`, with another model or other values where given."""
        facts = SFJ_STAGES[stage]
        values: dict[str, Any] = {
            "torque_constant": facts.torque_constant, "stiffness": facts.stiffness,
            "current_limit": facts.current_limit, "drive_resolution": facts.drive_resolution,
            "joint_resolution": facts.joint_resolution, "sense_offset": SENSE_OFFSET[stage],
        }
        return cls(sfj_stage_model(stage) if model is None else model, **{**values, **changes})


@dataclass(frozen=True)
class _Surroundings:
    """What a stage can run into; parameters that end up as effects of its model."""

    wall_angle: float = quantity(
        math.inf, "rad", "arm angle of a wall; its sign says on which side it lies; .inf: none", name="wall.angle",
        infinite=True,
    )
    wall_stiffness: float = quantity(2000.0, "N·m/rad", "stiffness of the wall", name="wall.stiffness", above=0.0)
    wall_dissipation: float = quantity(
        0.0, "s/rad", "damping of the wall (Hunt and Crossley)", name="wall.dissipation", minimum=0.0, maximum=10.0
    )
    range: float = quantity(
        0.5 * math.pi, "rad", "drive angle of the end stops either side; .inf: none", above=0.0, infinite=True
    )
    range_stiffness: float = quantity(500.0, "N·m/rad", "stiffness of the end stops", name="range_stiffness", above=0.0)

    def apply(self, model: Model) -> Model:
        if math.isfinite(self.wall_angle):
            wall = {"angle": self.wall_angle, "stiffness": self.wall_stiffness, "dissipation": self.wall_dissipation}
            effect = Effect("hard_stop", model.location("arm"), wall)
            model = add_effect(model, effect, f"parameter {model.joint}.wall.angle")
        stop = Effect("hard_stop", model.location("motor"),
                      {"angle": self.range, "stiffness": self.range_stiffness, "dissipation": 1.0, "both_sides": 1.0})
        if math.isfinite(self.range) and not any(
            (e.effect, e.location) == (stop.effect, stop.location) for e in model.effects
        ):
            model = model.with_effects(stop)
        return model


def _table() -> ParameterTable:
    found = [
        Parameter("rate", SFJ_RATE_HZ, "Hz", 10.0, 10_000.0, meaning="samples per second"),
        Parameter("timeout", 0.05, "s", 0.005, 0.2, meaning="age of a command at which the current goes to zero"),
        Parameter("seed", 1, minimum=0, meaning="seed of current-sense noise and disturbance"),
    ]
    for stage in STAGES:
        found.append(Parameter(
            f"{stage}.model", "", meaning="model file of the plant, relative to the parameter file; empty: built-in",
        ))
        found += parameters_of(_Surroundings(), f"{stage}.", runtime=False)
        found += parameters_of(StageSettings.for_stage(stage), f"{stage}.", runtime=False)
    return ParameterTable("sfj_sim", found)


SFJ_PARAMETERS = _table()
"""Parameters of the simulated 2DSFJ: those of a node `sfj_sim`, and of the lockstep runner."""


@dataclass(frozen=True)
class SfjSettings:
    """Both stages. Raises ConfigurationError when a model belongs to another joint."""

    stage1: StageSettings = field(default_factory=lambda: StageSettings.for_stage("stage1"))
    stage2: StageSettings = field(default_factory=lambda: StageSettings.for_stage("stage2"))

    def __post_init__(self) -> None:
        for stage in fields(self):
            model = getattr(self, stage.name).model
            if model.joint != stage.name:
                raise ConfigurationError(
                    f"{model.source}: this is a model of {model.joint}; give {stage.name} one of its own."
                )

    @classmethod
    def from_parameters(
        cls, values: Mapping[str, Any], folder: str | Path | None = None, source: str = "parameters"
    ) -> Self:
        """From flat parameters (checked against SFJ_PARAMETERS); model files are looked for in `folder` first.

        Raises ConfigurationError or ModelError naming file, key and remedy.
        """
        checked = SFJ_PARAMETERS.check(values, source)
        stages = []
        for stage in STAGES:
            model = choose_model(stage, checked[f"{stage}.model"], sfj_stage_model, folder, source)
            model = from_parameters(_Surroundings, checked, f"{stage}.").apply(model)
            stages.append(from_parameters(StageSettings, checked, f"{stage}.", model=model))
        return cls(*stages)


class SfjRobot:
    """The 2DSFJ in motion, at rest at zero at first.

    Order of one sample: `sense`, then `step` with the effort that acts until the next `sense`. dt: s. seed: of
    current-sense noise and disturbance. time: s. current: (2,) A, what flows.
    """

    names = SFJ_JOINTS

    def __init__(self, settings: SfjSettings | None = None, dt: float = 1.0 / SFJ_RATE_HZ, seed: int = 1) -> None:
        self.settings = settings = SfjSettings() if settings is None else settings
        self.dt = float(dt)
        self._stages = (settings.stage1, settings.stage2)
        self.plants = tuple(Plant(stage.model, dt) for stage in self._stages)
        self._random = np.random.default_rng(seed)
        self._filter = VelocityFilter(4, dt)
        self.reset()

    @classmethod
    def from_parameters(
        cls, values: Mapping[str, Any], dt: float | None = None, folder: str | Path | None = None,
        source: str = "parameters",
    ) -> Self:
        """The robot that parameters describe (SFJ_PARAMETERS); dt defaults to 1/`rate`."""
        checked = SFJ_PARAMETERS.check(values, source)
        step = 1.0 / checked["rate"] if dt is None else dt
        return cls(SfjSettings.from_parameters(checked, folder, source), step, checked["seed"])

    def reset(self) -> None:
        """Both stages at rest at zero, no current; the random sequence goes on."""
        for plant in self.plants:
            plant.reset()
        self.current = np.zeros(2)
        self._disturbance = [0.0, 0.0]
        self._acceleration = [0.0, 0.0]
        self._noise = np.zeros((0, 4))
        self._used = 0
        self._filter.reset(0.0)

    @property
    def time(self) -> float:
        return self.plants[0].time

    def sense(self) -> tuple[Array, Array, Array]:
        """Position (4,), rad, velocity (4,), rad/s, and effort (4,), N·m, as the driver would publish them.

        Call it once per sample: the velocity filter and the noise move on.
        """
        if self._used >= len(self._noise):
            self._noise = self._random.standard_normal((_NOISE_BLOCK, 4))
            self._used = 0
        noise = self._noise[self._used]
        self._used += 1
        position, effort = np.empty(4), np.empty(4)
        for i, (stage, plant) in enumerate(zip(self._stages, self.plants, strict=True)):
            motor, arm = plant.readings()
            position[2 * i] = _quantise(motor, stage.drive_resolution)
            position[2 * i + 1] = _quantise(arm, stage.joint_resolution)
            measured = self.current[i] + stage.sense_offset + stage.sense_noise * noise[i]
            effort[2 * i] = _quantise(measured, stage.sense_resolution) * stage.torque_constant
            effort[2 * i + 1] = stage.stiffness * (position[2 * i] - position[2 * i + 1])
        return position, self._filter.step(position), effort

    def step(self, effort_command: ArrayLike) -> StepResult:
        """One sample with `effort_command` (2,), N·m, at the two motors; says what was done to it."""
        result = StepResult.OK
        noise = self._noise[self._used - 1] if self._used else np.zeros(4)
        efforts = np.asarray(effort_command, dtype=np.float64)
        accelerations = self._acceleration
        self._acceleration = [0.0, 0.0]
        for i, (stage, plant) in enumerate(zip(self._stages, self.plants, strict=True)):
            wanted = float(efforts[i]) / stage.torque_constant
            if not math.isfinite(wanted):
                wanted = 0.0
                result |= StepResult.REFUSED_COMMAND
            if abs(wanted) > stage.current_limit:
                result |= StepResult.LIMITED
                wanted = math.copysign(stage.current_limit, wanted)
            self.current[i] = _quantise(wanted, stage.amplifier_resolution)
            if stage.disturbance_rms > 0.0:
                memory = math.exp(-2.0 * math.pi * stage.disturbance_cutoff_hz * self.dt)
                fresh = math.sqrt(1.0 - memory * memory) * stage.disturbance_rms * noise[2 + i]
                self._disturbance[i] = memory * self._disturbance[i] + fresh
                plant.state[-2] = self._disturbance[i]
            before = plant.state[3]
            plant.step(self.current[i], exogenous=accelerations[1 - i])
            if not plant.finite:
                plant.reset()
                result |= StepResult.DIVERGED
            self._acceleration[i] = (plant.state[3] - before) / self.dt
        return result


def _quantise(value: float, resolution: float) -> float:
    return round(value / resolution) * resolution if resolution > 0.0 else value
