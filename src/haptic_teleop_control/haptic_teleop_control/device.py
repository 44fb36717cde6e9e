"""What the nodes of both drivers expect of a driver: the same few calls for a board and for a haptic device.

A driver owns its device and is used by one thread. It never raises while it runs: it reports faults by name
through `Reporter` and keeps the output at zero.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import Enum
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.faults import FaultLatch

Array = NDArray[np.float64]


class ReadResult(Enum):
    """What one `read` brought."""

    STATE = "state"
    """A new sample: position, velocity and effort are valid."""
    NOTHING = "nothing"
    """No sample that may be published, for example before calibration; go on."""
    LOST = "lost"
    """The device does not answer; only `reset` can bring it back."""
    END = "end"
    """The replayed session is over."""


class DeviceError(Exception):
    """A device refused a call or is gone. code: the manufacturer's, 0 where there is none."""

    def __init__(self, message: str, code: int = 0) -> None:
        super().__init__(message)
        self.code = code


class EndOfSession(Exception):
    """A replayed session holds no more packets."""


class Driver(Protocol):
    """position (joints,) rad, velocity rad/s, effort N·m: views, valid after `read` returned STATE."""

    position: Array
    velocity: Array
    effort: Array

    def open(self) -> None:
        """Opens the device with its output at zero. Raises HapticTeleopError or DeviceError."""

    def read(self) -> ReadResult:
        """Waits for the next sample and checks it."""
        ...

    def write(self, effort: Array | None) -> None:
        """Sends a command (motors,), N·m, after all limits; None: zero, and power off."""

    def reset(self) -> None:
        """After a fault was reset: rearms watchdogs, opens a lost device again, forgets budgets' trips."""

    def close(self) -> None:
        """Zero, power off, device released; may be called at any time and more than once."""

    def describe(self) -> str:
        """One line for the log: which device, and what it may do."""
        ...

    def measurements(self) -> dict[str, Any]:
        """Values for diagnostics."""
        ...


class Reporter:
    """Where a driver reports faults. `latched` says whether one waits for its reset.

    report: called with name and detail of each fault, as `HapticNode.fault`; latched: the name, or None.
    """

    def __init__(self, report: Callable[[str, str], Any], latched: Callable[[], str | None]) -> None:
        self.fault = report
        self._latched = latched

    @property
    def latched(self) -> bool:
        return self._latched() is not None

    @classmethod
    def to_latch(cls, names: Mapping[str, str]) -> tuple[Reporter, FaultLatch]:
        """A reporter that only counts, and its latch: for programs without a node."""
        latch = FaultLatch(names)
        return cls(latch.count, lambda: latch.latched), latch
