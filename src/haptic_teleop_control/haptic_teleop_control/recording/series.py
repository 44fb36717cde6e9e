"""The joint states of one topic over time, as arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.errors import RecordingError

FIELDS = ("position", "velocity", "effort")
NANOSECONDS = 1_000_000_000


@dataclass(frozen=True)
class JointStateSeries:
    """n messages of type sensor_msgs/JointState on one topic.

    stamp     (n,) int64, ns: ``header.stamp``, the sampling time
    received  (n,) int64, ns: when the recorder received the message (log time)
    names     joint names, in the order of the columns
    position, velocity, effort
              (n, joints) float64, rad, rad/s, N·m; None when the field is empty in every message;
              NaN where a single message did not carry the value
    frame_id  ``header.frame_id`` of the first message
    problems  sentences about messages that could not be taken as they were

    Raises ValueError when the shapes do not belong together.
    """

    stamp: NDArray[np.int64]
    received: NDArray[np.int64]
    names: tuple[str, ...]
    position: NDArray[np.float64] | None = None
    velocity: NDArray[np.float64] | None = None
    effort: NDArray[np.float64] | None = None
    frame_id: str = ""
    problems: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.stamp.ndim != 1 or self.stamp.shape != self.received.shape:
            raise ValueError(f"stamp {self.stamp.shape} and received {self.received.shape} must both be (n,)")
        for field in FIELDS:
            values = getattr(self, field)
            if values is not None and values.shape != (len(self.stamp), len(self.names)):
                raise ValueError(
                    f"{field} has shape {values.shape}, not {(len(self.stamp), len(self.names))}"
                )

    def __len__(self) -> int:
        return len(self.stamp)

    def time(self, origin: int | None = None) -> NDArray[np.float64]:
        """Sampling times, (n,) s, relative to ``origin`` (ns; the first stamp when None)."""
        if not len(self):
            return np.zeros(0)
        start = int(self.stamp[0]) if origin is None else origin
        return (self.stamp - start) / NANOSECONDS

    def signal(self, joint: str, field: str) -> NDArray[np.float64]:
        """One joint's ``position``, ``velocity`` or ``effort``, (n,) in SI units.

        Raises RecordingError when the joint or the field was not recorded.
        """
        if joint not in self.names:
            known = ", ".join(self.names) or "none"
            raise RecordingError(f"no joint {joint!r} in the recorded messages: name one of {known}")
        values = getattr(self, field) if field in FIELDS else None
        if values is None:
            present = ", ".join(f for f in FIELDS if getattr(self, f) is not None) or "none"
            raise RecordingError(
                f"the recorded messages carry no {field!r} of {joint!r}: recorded are {present}"
            )
        return values[:, self.names.index(joint)]
