"""Whether the thread that owns a device comes back from it.

A driver reports what its device refuses. A device that neither answers nor refuses holds the driver's only
thread, which then can report nothing: somebody else has to look.
"""

from __future__ import annotations

from haptic_teleop_control.clocks import Clock
from haptic_teleop_control.parameters import Parameter

DEVICE_HANGS = "device_hangs"

DEVICE_FAULTS = {
    DEVICE_HANGS: "the device does not come back from a call within device_timeout (0.5 s by default); check "
    "its cable, its power and who else uses it, then reset"
}
"""Faults of any device, with the sentence for the log."""

DEVICE_TIMEOUT = Parameter(
    "device_timeout",
    0.5,
    "s",
    0.05,
    10.0,
    meaning="longest time of one call of the device; opening it may take longer",
)

LOOK_PERIOD = 0.1
"""s between two looks."""

OPENING_TIME = 10.0
"""s that a device may take to be opened anew: a card on USB loads its firmware."""


class DeviceWatch:
    """`enter` and `leave` are called by the thread that owns the device, `look` by another every LOOK_PERIOD.
    Time counts only while somebody looks: a machine that stands still is no device that hangs."""

    def __init__(self, clock: Clock, timeout: float) -> None:
        self.clock, self._timeout = clock, timeout
        self._inside: tuple[str, float, int] | None = None  # call, its bound in s, when it began in ns
        self._seen: tuple[str, float, int] | None = None
        self._looked = clock.now()
        self._away = 0

    def enter(self, call: str, bound: float | None = None) -> None:
        """The thread goes into `call` of the device, for `bound` s at most (None: the timeout)."""
        self._inside = (call, self._timeout if bound is None else bound, self.clock.now())

    def leave(self) -> None:
        """It is back."""
        self._inside = None

    def look(self) -> tuple[str, float] | None:
        """The call that the thread has not come back from in time, and for how long it is away, s; None while
        all is well."""
        inside, now, before = self._inside, self.clock.now(), self._looked
        self._looked = now
        if inside is None or inside is not self._seen:
            self._seen, self._away = inside, 0
            before = now if inside is None else max(before, inside[2])
        self._away += min(now - before, round(2e9 * LOOK_PERIOD))
        if inside is None or self._away <= inside[1] * 1e9:
            return None
        return inside[0], self._away * 1e-9
