"""The simulated 2DSFJ with MuJoCo as its physics: same models, hardware and signals as `SfjRobot`, another
engine.

It stands in for a machine that was not made by this project: what the diagnosis learns from it was not
computed by the kernel that the diagnosis calculates with. MuJoCo is imported when a robot is made.
"""

from __future__ import annotations

import importlib
import importlib.util
import math
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from haptic_teleop_control.errors import ConfigurationError, ModelError
from haptic_teleop_control.filters import VelocityFilter
from haptic_teleop_control.robots import SFJ_JOINTS, SFJ_MOTOR_JOINTS, SFJ_RATE_HZ, STAGES

from .mujoco_effects import stage_words
from .mujoco_model import mjcf
from .sfj_robot import SFJ_PARAMETERS, SfjSettings
from .step_result import StepResult

Array = NDArray[np.float64]

TIMESTEP = 1e-4
"""s of one step of MuJoCo, at most; a sample is a whole number of them."""


def mujoco_module() -> Any:
    """The module `mujoco`. Raises ConfigurationError with the remedy where it is not installed."""
    try:
        return importlib.import_module("mujoco")
    except ImportError:
        raise ConfigurationError(
            "MuJoCo is not installed: pip install mujoco, or take sfj_sim in place of mujoco_sim."
        ) from None


def mujoco_installed() -> bool:
    """Whether `mujoco_module` would succeed, without importing it."""
    return importlib.util.find_spec("mujoco") is not None


class MujocoRobot:
    """The 2DSFJ in MuJoCo. Order of one sample: `sense`, then `step` with the effort that acts until the next
    `sense`; commands are (2,), signals (4,), as of `SfjRobot`.

    settings: both stages; their models' effects must be among those that MuJoCo expresses (ModelError).
    dt: s. seed: of noise and disturbances. Raises ConfigurationError without MuJoCo.
    """

    namespace = "/sfj"
    names = SFJ_JOINTS
    motors = SFJ_MOTOR_JOINTS

    def __init__(
        self, settings: SfjSettings | None = None, dt: float = 1.0 / SFJ_RATE_HZ, seed: int = 1
    ) -> None:
        self.settings = SfjSettings() if settings is None else settings
        if self.settings.operator.mode != "none":
            raise ConfigurationError(
                "operator.mode: no hand can push the arms in MuJoCo; set it to none, or take sfj_sim in "
                "place of mujoco_sim."
            )
        self.powered = True
        self.dt = float(dt)
        joints = (self.settings.stage1, self.settings.stage2)
        self._stages = [stage_words(joint.model) for joint in joints]
        self._substeps = max(1, math.ceil(self.dt / TIMESTEP - 1e-9))
        self._mujoco = mujoco_module()
        text = mjcf(dict(zip(STAGES, self._stages, strict=True)), self.dt / self._substeps)
        try:
            self.model = self._mujoco.MjModel.from_xml_string(text)
        except ValueError as error:
            raise ModelError(
                f"MuJoCo {self._mujoco.__version__} refuses the 2DSFJ ({str(error).strip()}): "
                "install MuJoCo 3.17 or newer, or use sfj_sim."
            ) from None
        self.data = self._mujoco.MjData(self.model)
        self._inertia = self.model.dof_armature.copy(), self.model.dof_M0.copy()
        self._hardware = np.array([joint.row(self.dt) for joint in joints]).T
        self._start = np.array([joint.initial_angle for joint in joints])
        addresses = {name: int(self.model.joint(name).qposadr[0]) for name in SFJ_JOINTS}
        self._hinges = np.array([addresses[name] for name in SFJ_JOINTS])
        self._random = np.random.default_rng(seed)
        self._filter = VelocityFilter(4, self.dt)
        self._constant = np.array([torque for words in self._stages for torque in words.torque])
        self._late = [round(words.delay * self._substeps / self.dt) for words in self._stages]
        longest = max(self._late) // self._substeps + 2
        self._past = np.zeros((longest, 2))  # newest first
        self.reset()

    @classmethod
    def from_parameters(
        cls,
        values: Mapping[str, Any],
        dt: float | None = None,
        folder: str | Path | None = None,
        source: str = "parameters",
    ) -> Self:
        """The robot that parameters describe (SFJ_PARAMETERS); dt, s, defaults to 1/`rate`."""
        checked = SFJ_PARAMETERS.check(values, source)
        step = 1.0 / checked["rate"] if dt is None else dt
        return cls(SfjSettings.from_parameters(checked, folder, source), step, checked["seed"])

    def reset(self) -> None:
        """Every joint at rest at its initial angle, nothing flows; the random sequence goes on."""
        self.model.dof_armature[:], self.model.dof_M0[:] = self._inertia
        self._mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[self._hinges] = np.repeat(self._start, 2)
        self._past[:] = 0.0
        self._flow, self._disturbance = np.zeros(2), np.zeros(2)
        self._filter.reset(self._shown())

    @property
    def time(self) -> float:
        """s since the last reset."""
        return float(self.data.time)

    @property
    def torque_constants(self) -> Array:
        """(2,) nominal effort per command, N·m/A."""
        return self._hardware[0].copy()

    @property
    def flow(self) -> Array:
        """(2,) A that the amplifiers give now."""
        return self._flow.copy()

    def sense(self) -> tuple[Array, Array, Array]:
        """Position, rad, velocity, rad/s, and effort, N·m, of the four joints, as of a driver."""
        constant, _, _, _, _, offset, noise, resolution, stiffness, _, _ = self._hardware
        position = self._shown()
        velocity = self._filter.step(position)
        effort = np.empty(4)
        current = self._flow + offset + noise * self._random.standard_normal(2)
        effort[0::2] = constant * _quantised(current, resolution)
        effort[1::2] = stiffness * (position[0::2] - position[1::2])
        return position, velocity, effort

    def step(self, effort_command: ArrayLike) -> StepResult:
        """One sample with `effort_command` (2,), N·m, at the motors; says what was done to it."""
        constant, limit, resolution, _, _, _, _, _, _, memory, gain = self._hardware
        result = StepResult.OK
        wanted = np.asarray(effort_command, dtype=np.float64) / constant
        if not np.all(np.isfinite(wanted)):
            wanted, result = np.where(np.isfinite(wanted), wanted, 0.0), result | StepResult.REFUSED_COMMAND
        if np.any(np.abs(wanted) > limit):
            result |= StepResult.LIMITED
        self._flow = np.clip(_quantised(np.clip(wanted, -limit, limit), resolution), -limit, limit)
        self._disturbance = memory * self._disturbance + gain * self._random.standard_normal(2)
        true_constants = [words.model.parameters["torque_constant"] for words in self._stages]
        self._past[1:] = self._past[:-1].copy()
        self._past[0] = self._flow * true_constants
        applied = self._constant.copy()
        applied[0::2] += self._disturbance
        self.data.qfrc_applied[self._hinges] = applied
        self._load()
        self._advance()
        if not (np.all(np.isfinite(self.data.qpos)) and np.max(np.abs(self.data.qpos)) < 1e4):
            self.reset()
            result |= StepResult.DIVERGED
        return result

    def _shown(self) -> Array:
        """(4,) what the encoders count, rad."""
        resolution = self._hardware[3:5].T.ravel()
        return _quantised(self.data.qpos[self._hinges], resolution)

    def _load(self) -> None:
        """Attach what is to be attached by now, as armature: of simple bodies MuJoCo reads M0 instead."""
        for number, words in enumerate(self._stages):
            if words.payload is not None and self.time >= words.payload[0]:
                arm = self._hinges[2 * number + 1]
                for inertia, before in zip(
                    (self.model.dof_armature, self.model.dof_M0), self._inertia, strict=True
                ):
                    inertia[arm] = before[arm] + words.payload[1]

    def _advance(self) -> None:
        """MuJoCo's steps of one sample; a delayed torque changes between two of them."""
        turns = sorted({0, self._substeps, *(late % self._substeps for late in self._late)})
        for begin, end in pairwise(turns):
            for number, (words, late) in enumerate(zip(self._stages, self._late, strict=True)):
                age = late // self._substeps + (1 if begin < late % self._substeps else 0)
                torque = self._past[age, number]
                self.data.ctrl[number] = math.copysign(max(abs(torque) - words.dead, 0.0), torque)
            self._mujoco.mj_step(self.model, self.data, end - begin)


def _quantised(values: Array, resolution: Array) -> Array:
    """`values` rounded to multiples of `resolution`; 0 leaves them as they are."""
    step = np.where(resolution > 0.0, resolution, 1.0)
    return np.where(resolution > 0.0, np.rint(values / step) * step, values)
