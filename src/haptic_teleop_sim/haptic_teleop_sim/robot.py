"""What both simulated robots have in common: joints behind encoders, amplifiers and a current sense."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from haptic_teleop_control.filters import velocity_coefficients
from haptic_teleop_control.robots import VELOCITY_FILTER_CUTOFF_HZ, VELOCITY_FILTER_DAMPING

from .joint_hardware import JointHardware
from .kernel import stepping
from .operators import Operator
from .plant_bank import PlantBank
from .step_result import StepResult

Array = NDArray[np.float64]
_NOISE_BLOCK = 1024


class Robot:
    """m joints in motion. Order of one sample: `sense`, then `step` with the effort that acts until the next
    `sense`.

    names: joints, in the order of the signals. motors: the joints that take a command. dt: s. seed: of noise
    and disturbances; equal seeds give equal runs, bit by bit. operator: whose hands hold the joints, inside
    the dynamics. powered: whether the device is commanded at present; what it adds of its own acts only then.
    bank, device: what compiled loops take, see `kernel/stepping.py`.
    """

    namespace: str
    names: tuple[str, ...]
    motors: tuple[str, ...]
    encoders: int
    """Encoders per joint: 2 where the arm has its own."""

    def __init__(
        self, joints: Sequence[JointHardware], dt: float, seed: int, operator: Operator | None = None
    ) -> None:
        self.dt = float(dt)
        self.operator = Operator() if operator is None else operator
        self.powered = True
        self.joints = self.operator.grip(joints)
        self.plants = PlantBank([joint.model for joint in self.joints], dt)
        m = len(self.joints)
        self._now = np.zeros(1)
        self._random = np.random.default_rng(seed)
        self._functions = stepping()
        self._filter_state = np.zeros((self.encoders * m, 3))
        self._flow, self._disturbance, self._acceleration = np.zeros(m), np.zeros(m), np.zeros(m)
        coefficients = velocity_coefficients(self.dt, VELOCITY_FILTER_CUTOFF_HZ, VELOCITY_FILTER_DAMPING)
        self.bank = self.plants.arrays
        hardware = np.array([joint.row(self.dt) for joint in self.joints])
        self.device = (
            hardware,
            self._filter_state,
            coefficients,
            self._flow,
            self._disturbance,
            self._acceleration,
            np.zeros((3, m)),
            self.encoders,
        )
        self._angles = np.zeros((m, 2))
        self._out = np.zeros((3, self.encoders * m))
        self._signals = (self._out[0], self._out[1], self._out[2])
        self._effort, self._external = np.zeros(m), np.zeros(m)
        self._noise = np.zeros((0, 2 * m))
        self._row = self._used = 0
        self.reset()

    def reset(self) -> None:
        """Every joint at rest at its initial angle, nothing flows; the random sequence goes on."""
        angles = [joint.initial_angle for joint in self.joints]
        self.plants.reset([(angle, angle, 0.0, 0.0) for angle in angles])
        # The filters begin at what the encoders show, so that nothing seems to move.
        self._functions.bank_read(self.bank, self._angles)
        resolution = self.device[0][:, 3:5]
        step = np.where(resolution > 0.0, resolution, 1.0)
        shown = np.where(resolution > 0.0, np.rint(self._angles / step) * step, self._angles)
        self._filter_state[:, 0] = self._filter_state[:, 2] = shown[:, : self.encoders].ravel()
        self._filter_state[:, 1] = 0.0
        for memory in (self._flow, self._disturbance, self._acceleration):
            memory[:] = 0.0

    @property
    def time(self) -> float:
        """s since the last reset."""
        return self.plants.time

    @property
    def torque_constants(self) -> Array:
        """(m,) nominal effort per command, N·m/A: times a current it is the effort to command."""
        return np.array([joint.torque_constant for joint in self.joints])

    @property
    def flow(self) -> Array:
        """(m,) what the amplifiers give now: A for the 2DSFJ, N·m for the Omni. A view."""
        return self._flow

    def sense(self) -> tuple[Array, Array, Array]:
        """Position, rad, velocity, rad/s, and effort, N·m, of every joint in `names`, as the driver would
        publish.

        Call it once per sample, because the velocity filter and the noise move on. The arrays are views that
        the next call overwrites.
        """
        self._row = self._used
        if self._row == len(self._noise):
            self._noise = self._random.standard_normal((_NOISE_BLOCK, 2 * len(self.joints)))
            self._row = 0
        self._used = self._row + 1
        self._functions.robot_sense(self.bank, self.device, self._noise[self._row], self._angles, self._out)
        return self._signals

    def step(self, effort_command: ArrayLike, external_torque: ArrayLike | None = None) -> StepResult:
        """One sample with `effort_command` (m,), N·m, at the motors; says what was done to it.

        `external_torque` (m,), N·m, acts at the arms, or at the bodies where they are rigid, beside the
        operator's; a value that is not finite counts as zero.
        """
        self._effort[:] = effort_command
        self._external[:] = 0.0 if external_torque is None else external_torque
        if self.operator.mode != "none":
            self._now[0] = self.time
            self._external += self.operator.torques(self._now)[0]
        if not len(self._noise):
            self.sense()
        row = self._noise[self._row]
        return StepResult(
            self._functions.robot_step(self._effort, self._external, self.bank, self.device, row)
        )

    def take_noise(self, n: int) -> Array:
        """(n, 2 m) the noise of the next n samples, for compiled loops that bypass `sense` and `step`."""
        kept = self._noise[self._used :]
        fresh = self._random.standard_normal((max(n - len(kept), 0), 2 * len(self.joints)))
        self._noise = np.concatenate([kept, fresh])
        taken = self._noise[:n].copy()
        self._used = n
        return taken
