"""A force law from one function: the current of one stage at one sample. The rest of the contract is here.

A law whose stages know nothing of each other needs settings (a dataclass of quantities, which become its
parameters), a function that returns a current, and how many numbers that function remembers. Refused inputs,
disabled stages, the current limit, parameters and states are the same for all of them.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.laws.contract import Array, ForceLaw, LawResult
from haptic_teleop_control.laws.gain_ramp import RAMP_TIME
from haptic_teleop_control.parameters import Parameter
from haptic_teleop_control.quantities import parameters_of_each, settings_of_each

_OK, _SATURATED = int(LawResult.OK), int(LawResult.SATURATED)
_REFUSED_INPUT, _DISABLED = int(LawResult.REFUSED_INPUT), int(LawResult.DISABLED)


class StageLaw(ForceLaw):
    """A law for n stages, each by itself, stepped every dt, s. A subclass states SETTINGS, MEMORY, `current`.

    settings: one SETTINGS for each stage. Raises ConfigurationError for no stage or a dt that is no time.
    state: (n, MEMORY), all zero after a reset.
    """

    SETTINGS: ClassVar[Any]
    """A frozen dataclass of `quantity` fields, among them `torque_constant`, N·m/A, and `current_limit`, A;
    its class method `for_stage(stage)` gives the values for "stage1" and "stage2"."""

    MEMORY: ClassVar[int] = 0
    """How many numbers `current` remembers of a stage."""

    @staticmethod
    @abstractmethod
    def current(
        desired: float, motor: float, arm: float, velocity: float, memory: Array, constants: Any, dt: float
    ) -> float:
        """The current wanted, A, before the current limit.

        desired: Td, N·m. motor, arm: angles, rad. velocity: of the motor, rad/s. memory: (MEMORY,), all zero
        at the first sample, changed in place. constants: the stage's settings, or what `constants` makes of
        them. dt: s. Inputs are finite. A result that is not finite, or an arithmetic error, counts as
        refused: no current, memory as before. May be compiled by numba.
        """

    @classmethod
    def constants(cls, settings: Any, dt: float) -> Any:
        """What `current` gets of a stage's settings: by default the settings themselves."""
        return settings

    def carry_over(self, memory: Array, old: Any, new: Any) -> None:
        """Changes `memory` in place when settings change while running, so that the torque does not jump."""

    def __init__(self, settings: Sequence[Any], dt: float) -> None:
        if not settings:
            raise ConfigurationError(f"{type(self).__name__}: no stage; give the settings of at least one.")
        if not (math.isfinite(dt) and dt > 0.0):
            raise ConfigurationError(f"{type(self).__name__}: dt is {dt} s; choose a finite time above 0.")
        self.dt = float(dt)
        self.stages = len(settings)
        self.enabled = np.ones(self.stages, dtype=np.bool_)
        self.results = np.zeros(self.stages, dtype=np.int64)
        self._memory = np.zeros((self.stages, self.MEMORY))
        self._before = np.zeros(self.MEMORY)
        self._inputs = np.zeros((4, self.stages))
        self._current = np.zeros(self.stages)
        self._settings: tuple[Any, ...] = ()
        self._aims: tuple[Any, ...] = ()
        self._left = 0
        self.settings = tuple(settings)
        self.step(*np.zeros((4, self.stages)))  # a compiled `current` compiles now, not in the loop
        self.reset()

    def step(
        self,
        desired_torque: ArrayLike,
        motor_position: ArrayLike,
        arm_position: ArrayLike,
        motor_velocity: ArrayLike,
    ) -> Array:
        if self._left:
            self._approach()
        inputs = self._inputs
        inputs[0] = desired_torque
        inputs[1] = motor_position
        inputs[2] = arm_position
        inputs[3] = motor_velocity
        for stage, (desired, motor, arm, velocity) in enumerate(inputs.T.tolist()):
            done = self._stage(stage, desired, motor, arm, velocity)
            self._current[stage], self.results[stage] = done
        return self._current.copy()

    def _stage(
        self, stage: int, desired: float, motor: float, arm: float, velocity: float
    ) -> tuple[float, int]:
        memory = self._memory[stage]
        if not self.enabled[stage]:
            memory[:] = 0.0
            return 0.0, _DISABLED
        if not (
            math.isfinite(desired) and math.isfinite(motor) and math.isfinite(arm) and math.isfinite(velocity)
        ):
            return 0.0, _REFUSED_INPUT
        self._before[:] = memory
        try:
            constants = self._constants[stage]
            wanted = float(self.current(desired, motor, arm, velocity, memory, constants, self.dt))
        except ArithmeticError:
            wanted = math.nan
        if not (math.isfinite(wanted) and all(map(math.isfinite, memory.tolist()))):
            memory[:] = self._before
            return 0.0, _REFUSED_INPUT
        limit = self._limits[stage]
        return min(max(wanted, -limit), limit), _SATURATED if abs(wanted) > limit else _OK

    def reset(self, stage: int | None = None) -> None:
        if self._left:
            self._left = 1
            self._approach()
        self._memory[slice(None) if stage is None else stage] = 0.0

    @property
    def state(self) -> Array:
        return self._memory.copy()

    @state.setter
    def state(self, value: ArrayLike) -> None:
        self._memory[:] = np.asarray(value, dtype=np.float64).reshape(self._memory.shape)

    @property
    def settings(self) -> tuple[Any, ...]:
        """Settings of each stage. Assigning others takes them at once; `update` leads there on a line."""
        return self._aims

    @settings.setter
    def settings(self, settings: Sequence[Any]) -> None:
        self._check_number(settings)
        self._aims, self._left = tuple(settings), 0
        self._take(settings)

    def _check_number(self, settings: Sequence[Any]) -> None:
        if len(settings) != self.stages:
            name = type(self).__name__
            raise ConfigurationError(f"{name}: settings of {len(settings)} stages; give {self.stages}.")

    def _take(self, settings: Sequence[Any]) -> None:
        constants = [self.constants(one, self.dt) for one in settings]
        for memory, old, new in zip(self._memory, self._settings, settings, strict=False):
            self.carry_over(memory, old, new)
        self._settings, self._constants = tuple(settings), constants
        self._limits = [float(one.current_limit) for one in settings]
        self.torque_constant = np.array([float(one.torque_constant) for one in settings])

    def _approach(self) -> None:
        """One sample on towards the settings that `update` was given."""
        self._left -= 1
        pairs = zip(self._settings, self._aims, strict=True)
        self._take([_between(now, aim, 1.0 / (self._left + 1)) for now, aim in pairs])

    @classmethod
    def parameters(cls, stages: Sequence[str]) -> list[Parameter]:
        return parameters_of_each(cls._nominal(stages))

    @classmethod
    def from_parameters(cls, values: Mapping[str, Any], stages: Sequence[str], dt: float) -> Self:
        return cls(settings_of_each(cls._nominal(stages), values), dt)

    def update(self, values: Mapping[str, Any], stages: Sequence[str]) -> None:
        aims = settings_of_each(self._nominal(stages), values)
        self._check_number(aims)
        self._aims, self._left = tuple(aims), max(1, round(RAMP_TIME / self.dt))
        # What protects or only converts does not wait.
        self._take([_between(now, aim, 0.0) for now, aim in zip(self._settings, aims, strict=True)])

    @classmethod
    def _nominal(cls, stages: Sequence[str]) -> list[tuple[str, Any]]:
        """(prefix of the parameters, nominal settings) of each stage."""
        return [(f"{stage}.", cls.SETTINGS.for_stage(stage)) for stage in stages]


def _between(now: Any, aim: Any, share: float) -> Any:
    """Settings that lie between two valid ones, unchecked for that reason: checking would take too long in
    the loop. Limits, torque constants and what is no number are the aim's."""
    made = object.__new__(type(aim))
    for entry in fields(aim):
        value, wanted = getattr(now, entry.name), getattr(aim, entry.name)
        changes_evenly = isinstance(wanted, float) and entry.name not in ("torque_constant", "current_limit")
        between = changes_evenly and share < 1.0 and math.isfinite(value) and math.isfinite(wanted)
        object.__setattr__(made, entry.name, value + share * (wanted - value) if between else wanted)
    return made
