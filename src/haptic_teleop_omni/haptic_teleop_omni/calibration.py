"""Where the angles' origin is. The Omni's encoders count from wherever the device was switched on, so angles
mean nothing, and no torque may flow, until the device has been in a pose that is known.

    dock     the stylus rests in its inkwell (the device reports it) and does not move for a while
    button   the user holds the neutral pose (the marks on the casing) and presses button 1 for a while
    start    the pose at the start is known, for an emulated device or a jig

Where the vendor's library calibrates, its word is taken instead (`LIBRARY`), and its angles with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

METHODS = ("dock", "button", "start")
LIBRARY = "library"
WAITING = {
    "dock": "put the stylus into its inkwell and let it rest",
    "button": "hold the neutral pose (marks on the casing) and keep button 1 pressed",
    "start": "waiting for the first report",
    LIBRARY: "put the stylus into its inkwell and let it rest: the vendor's library then knows the angles",
}


@dataclass
class Calibration:
    """method of METHODS, or LIBRARY. angles: (3,) rad about neutral in that pose. hold: s. resolution: (3,)
    rad per count; the pose counts as at rest while no encoder leaves a band of `stillness` rad."""

    method: str
    angles: Sequence[float]
    hold: float
    resolution: Sequence[float]
    stillness: float = 0.02
    done: bool = False

    def __post_init__(self) -> None:
        self._held = 0.0
        self._first: list[int] = []
        self._origin = [0.0] * len(self.angles)

    @property
    def advice(self) -> str:
        """What the user is to do now."""
        return WAITING[self.method]

    def forget(self) -> None:
        """As after switching on."""
        self.done = False
        self._held = 0.0

    def step(
        self, counts: Sequence[int], docked: bool, button: bool, elapsed: float, known: bool = False
    ) -> bool:
        """One report, `elapsed` s after the last: unwrapped counts and what the device says; known: whether
        the vendor's library knows the angles. True when the calibration is complete with this report."""
        if self.done:
            return False
        if self.method == LIBRARY:
            self.done = known
            return known
        in_pose = {"dock": docked, "button": button, "start": True}[self.method]
        if self._held == 0.0 or not in_pose or self._moved(counts):
            self._first = list(counts)
            self._held = 0.0
        if not in_pose:
            return False
        self._held += elapsed
        if self.method != "start" and self._held < self.hold:
            return False
        self._origin = [
            angle - count * scale
            for angle, count, scale in zip(self.angles, counts, self.resolution, strict=True)
        ]
        self.done = True
        return True

    def angle(self, counts: Sequence[int]) -> list[float]:
        """Angles about neutral, rad; meaningful once `done`."""
        return [
            origin + count * scale
            for origin, count, scale in zip(self._origin, counts, self.resolution, strict=True)
        ]

    def _moved(self, counts: Sequence[int]) -> bool:
        return any(
            abs((now - first) * scale) > self.stillness
            for now, first, scale in zip(counts, self._first, self.resolution, strict=True)
        )
