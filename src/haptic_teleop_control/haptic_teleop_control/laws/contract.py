"""What every force law looks like, so that another one can be written beside the thesis'.

A law turns the torque that the operator wants and the measured state of the flexible joints into motor
currents. It is the same object in the simulated graph, in the lockstep runner and on the robot.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from haptic_teleop_control.parameters import Parameter

Array = NDArray[np.float64]


class LawResult(IntEnum):
    """What a law did with one stage in the last step."""

    OK = 0
    SATURATED = 1
    """The current limit held."""
    REFUSED_INPUT = 2
    """An input was not finite, or so large that the law's arithmetic overflowed: zero current, state kept."""
    DISABLED = 3
    """The stage is not enabled: zero current, integrator empty."""


class ForceLaw(ABC):
    """A law for n stages. Nothing here raises while stepping; what happened is in `results`."""

    stages: int
    """Number of stages n."""

    torque_constant: Array
    """(n,), N·m/A: current x torque_constant is the effort that goes into the command message."""

    enabled: NDArray[np.bool_]
    """(n,), writable: whether each stage may be driven."""

    results: NDArray[np.int64]
    """(n,), a LawResult for each stage, of the last step."""

    @abstractmethod
    def step(
        self,
        desired_torque: ArrayLike,
        motor_position: ArrayLike,
        arm_position: ArrayLike,
        motor_velocity: ArrayLike,
    ) -> Array:
        """Commanded currents (n,), A, within the current limits, from N·m, rad, rad and rad/s, (n,) each.

        Called once per sampling time dt. Raises ValueError when an argument does not have n values.
        """

    @abstractmethod
    def reset(self, stage: int | None = None) -> None:
        """Forget the past of one stage, or of all."""

    @property
    @abstractmethod
    def state(self) -> Array:
        """(n, k): all that the law remembers, as a copy. Assigning it restores that moment."""

    @state.setter
    @abstractmethod
    def state(self, value: ArrayLike) -> None: ...

    @classmethod
    @abstractmethod
    def parameters(cls, stages: Sequence[str]) -> list[Parameter]:
        """The law's parameters for a node, `stage1.lambda` and so on, with the defaults of each stage."""

    @classmethod
    @abstractmethod
    def from_parameters(cls, values: Mapping[str, Any], stages: Sequence[str], dt: float) -> Self:
        """The law from such parameters. Raises ConfigurationError naming the parameter."""

    @abstractmethod
    def update(self, values: Mapping[str, Any], stages: Sequence[str]) -> None:
        """Take changed parameters while running, without a jump of the torque in steady contact.

        Raises ConfigurationError naming the parameter, and then has changed nothing.
        """
