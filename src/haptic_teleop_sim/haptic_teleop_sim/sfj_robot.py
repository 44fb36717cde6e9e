"""The simulated Quanser 2DSFJ: two flexible joints, around them encoders, amplifiers and current sense, and
the hands that push its arms.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

from haptic_teleop_control.parameters import Parameter, ParameterTable
from haptic_teleop_control.quantities import from_parameters, parameters_of, quantity
from haptic_teleop_control.robots import SFJ_JOINTS, SFJ_MOTOR_JOINTS, SFJ_RATE_HZ, SFJ_STAGES, STAGES

from .default_models import sfj_stage_model
from .joint_hardware import JointHardware
from .model import Effect, Model
from .model_choice import add_effect, check_joint, choose_model
from .operators import Hand, Operator, operator_parameters
from .robot import Robot

#: 20 V over 2^12 steps of the analog output, at 0.5 A/V.
AMPLIFIER_RESOLUTION = 20.0 / 2**12 * 0.5
#: 20 V over 2^14 steps of the analog input, at 2 A/V.
SENSE_RESOLUTION = 20.0 / 2**14 * 2.0
#: A; on a 2DSFL, with the same amplifier, offsets between -9 and -23 mA and 5 to 16 mA of noise were
#: recorded.
SENSE_OFFSET = {"stage1": -0.015, "stage2": -0.02}
SENSE_NOISE = 0.01

ARM_HAND = Hand(inertia=0.01, damping=0.3, stiffness=15.0)
"""A hand on the arm of a stage; *assumed*: some 0.1 kg, 3 N·s/m and 160 N/m at 0.3 m from the joint."""


@dataclass(frozen=True)
class Surroundings:
    """What a stage can run into; ends up as `hard_stop` effects of its model."""

    wall_angle: float = quantity(
        math.inf,
        "rad",
        "arm angle of a wall; its sign says on which side it lies; .inf: none",
        name="wall.angle",
        infinite=True,
    )
    wall_stiffness: float = quantity(
        2000.0, "N·m/rad", "stiffness of the wall", name="wall.stiffness", above=0.0
    )
    wall_dissipation: float = quantity(
        0.0,
        "s/rad",
        "damping of the wall (Hunt and Crossley)",
        name="wall.dissipation",
        minimum=0.0,
        maximum=10.0,
    )
    range: float = quantity(
        0.5 * math.pi, "rad", "drive angle of the end stops either side; .inf: none", above=0.0, infinite=True
    )
    range_stiffness: float = quantity(500.0, "N·m/rad", "stiffness of the end stops", above=0.0)

    def apply(self, model: Model) -> Model:
        """`model` with wall and end stops; a stop that the model states itself is left alone.

        Raises ModelError when there is to be a wall and the model has one.
        """
        if math.isfinite(self.wall_angle):
            wall = {
                "angle": self.wall_angle,
                "stiffness": self.wall_stiffness,
                "dissipation": self.wall_dissipation,
            }
            effect = Effect("hard_stop", model.location("arm"), wall)
            model = add_effect(model, effect, f"parameter {model.joint}.wall.angle")
        motor = model.location("motor")
        stated = any((e.effect, e.location) == ("hard_stop", motor) for e in model.effects)
        if math.isfinite(self.range) and not stated:
            stop = {
                "angle": self.range,
                "stiffness": self.range_stiffness,
                "dissipation": 1.0,
                "both_sides": 1.0,
            }
            model = model.with_effects(Effect("hard_stop", motor, stop))
        return model


def stage_hardware(stage: str, model: Model | None = None, **changes: float) -> JointHardware:
    """The facts of `stage` ("stage1" or "stage2") around `model` (built-in by default), and `changes` to
    them.
    """
    facts = SFJ_STAGES[stage]
    values: dict[str, float] = {
        "torque_constant": facts.torque_constant,
        "command_limit": facts.current_limit,
        "command_resolution": AMPLIFIER_RESOLUTION,
        "drive_resolution": facts.drive_resolution,
        "joint_resolution": facts.joint_resolution,
        "sense_offset": SENSE_OFFSET[stage],
        "sense_noise": SENSE_NOISE,
        "sense_resolution": SENSE_RESOLUTION,
        "stiffness": facts.stiffness,
    }
    return JointHardware(sfj_stage_model(stage) if model is None else model, **{**values, **changes})


def _table() -> ParameterTable:
    found = [
        Parameter("rate", SFJ_RATE_HZ, "Hz", 10.0, 10_000.0, meaning="samples per second"),
        Parameter(
            "timeout", 0.05, "s", 0.005, 0.2, meaning="age of a command at which the current goes to zero"
        ),
        Parameter("seed", 1, minimum=0, meaning="seed of current-sense noise and disturbances"),
        *operator_parameters(STAGES, ARM_HAND),
    ]
    for stage in STAGES:
        found.append(
            Parameter(
                f"{stage}.model",
                "",
                meaning="model file of the plant, relative to the parameter file; empty: built-in",
            )
        )
        found += parameters_of(Surroundings(), f"{stage}.", runtime=False)
        found += parameters_of(stage_hardware(stage), f"{stage}.", runtime=False)
    return ParameterTable("sfj_sim", found)


SFJ_PARAMETERS = _table()
"""Parameters of the simulated 2DSFJ: those of the node `sfj_sim`, and of the lockstep runner."""


@dataclass(frozen=True)
class SfjSettings:
    """Both stages, and who pushes their arms. Raises ModelError when a model belongs to another joint."""

    stage1: JointHardware = field(default_factory=lambda: stage_hardware("stage1"))
    stage2: JointHardware = field(default_factory=lambda: stage_hardware("stage2"))
    operator: Operator = field(default_factory=lambda: Operator("none", (ARM_HAND, ARM_HAND)))

    def __post_init__(self) -> None:
        for stage in STAGES:
            check_joint(getattr(self, stage).model, stage)

    @classmethod
    def from_parameters(
        cls,
        values: Mapping[str, Any],
        folder: str | Path | None = None,
        source: str = "parameters",
        models: Mapping[str, str] | None = None,
    ) -> Self:
        """From flat parameters (checked against SFJ_PARAMETERS); model files are looked for in `folder`
        first. models: path -> text of model files that need not be there.

        Raises ConfigurationError or ModelError naming file, key and remedy.
        """
        checked = SFJ_PARAMETERS.check(values, source)
        stages = []
        for stage in STAGES:
            model = choose_model(stage, checked[f"{stage}.model"], sfj_stage_model, folder, source, models)
            model = from_parameters(Surroundings, checked, f"{stage}.").apply(model)
            stages.append(from_parameters(JointHardware, checked, f"{stage}.", model=model))
        return cls(*stages, operator=Operator.from_parameters(checked, source, STAGES))


class SfjRobot(Robot):
    """The 2DSFJ in motion: efforts of the motors are measured current times nominal torque constant, those of
    the arms Te = Ks (theta_motor - theta_arm) of the quantised positions. Commands are (2,), signals (4,).
    """

    namespace = "/sfj"
    names = SFJ_JOINTS
    motors = SFJ_MOTOR_JOINTS
    encoders = 2

    def __init__(
        self, settings: SfjSettings | None = None, dt: float = 1.0 / SFJ_RATE_HZ, seed: int = 1
    ) -> None:
        self.settings = SfjSettings() if settings is None else settings
        stages = (self.settings.stage1, self.settings.stage2)
        super().__init__(stages, dt, seed, self.settings.operator)

    @classmethod
    def from_parameters(
        cls,
        values: Mapping[str, Any],
        dt: float | None = None,
        folder: str | Path | None = None,
        source: str = "parameters",
        models: Mapping[str, str] | None = None,
    ) -> Self:
        """The robot that parameters describe (SFJ_PARAMETERS); dt, s, defaults to 1/`rate`."""
        checked = SFJ_PARAMETERS.check(values, source)
        step = 1.0 / checked["rate"] if dt is None else dt
        return cls(SfjSettings.from_parameters(checked, folder, source, models), step, checked["seed"])
