"""An Omni that is not there: the very bytes of a layout, with a simulated Omni and its operator behind them.

Encoders start anywhere and wrap, reports are numbered, and as many as a kernel would keep wait for a late
reader. The torque of the last output report acts until the next one, whatever becomes of the host: how a real
device behaves when its host dies is not known, and this is the worst that it could do.

Where the driver lights the inkwell because it has lost the angles, the operator brings the stylus back, and
begins anew from there.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.clocks import Clock
from haptic_teleop_control.device import DeviceError
from haptic_teleop_omni.codec import ReportCodec
from haptic_teleop_omni.layout import ReportLayout

AXES = ("x", "y", "z")
BACKLOG = 64
"""Reports that wait for a late reader, as in the kernel's hidraw."""

LONGEST_CATCH_UP = 1000
NOTICED, BROUGHT = 0.5, 1.0
"""Seconds until the operator sees the inkwell's light, and until the stylus is back in it."""

RADIANS_PER_COUNT = 4.1e-4
"""Of each encoder: 0.055 mm at the end of a link of 0.135 m, as the data sheet has it. Stated here and not
read from the layout: with the layout's scale a wrong one would cancel out."""

NEWTON_METRES_PER_STEP = 2.5e-4
"""Of each torque; no source states it. Of this device it is so."""

START_COUNTS = (65_000, 300, 32_000)
"""Raw encoders at the neutral pose: X and Y wrap soon."""


class OmniPlant(Protocol):
    """The device's mechanics, in the operator's hand. `sense`, then `advance` with what acts from then."""

    def sense(self) -> NDArray[np.float64]:
        """Angles (3,), rad, about the neutral position."""
        ...

    def advance(self, command: NDArray[np.float64]) -> None:
        """One period with the torques (3,), N·m, of the motors."""


class EmulatedOmni:
    """Of the layout it takes where its values lie and how they are written, never what they mean.

    docked_time: s after the start for which the stylus rests in its inkwell, at neutral; the plant's
    time begins then. renew: makes the plant that goes on once the stylus has been brought back; without
    it nobody does.

    For tests: `buttons` [2] pressed or not, `drop` reports that get lost, `corrupt` reports that come
    cut short, `silent` to stop reporting, `unplug()` and `plug()`. torque (3,): what acts now, N·m;
    motors_on; refused: output reports that made no sense.
    """

    name = "emulated"
    emulated = True
    identity = serial = ""

    def __init__(
        self,
        plant: OmniPlant,
        layout: ReportLayout,
        clock: Clock,
        rate: float,
        docked_time: float = 0.5,
        renew: Callable[[], OmniPlant] | None = None,
    ) -> None:
        self._plant, self._layout, self._clock, self._renew = plant, layout, clock, renew
        self._in, self._out = ReportCodec(layout.input), ReportCodec(layout.output)
        self._period = round(1e9 / rate)
        self._docked_ticks = self._docked_until = round(docked_time * rate)
        self._noticed, self._brought = round(NOTICED * rate), round(BROUGHT * rate)
        self._lit_since: int | None = None
        self._on_the_way = 0  # samples until the stylus is back
        self._step = np.zeros(3)
        self.buttons = [False, False]
        self.drop = self.corrupt = self.refused = 0
        self.silent = False
        self.torque = np.zeros(3)
        self.motors_on = False
        self._gone = self._open = False
        self._start: int | None = None
        self._tick = 0
        self._angles = plant.sense().copy()

    def unplug(self) -> None:
        """The cable is pulled: every call fails, and the motors lose their power."""
        self._gone = True
        self._open = False
        self.torque[:] = 0.0
        self.motors_on = False

    def plug(self) -> None:
        """The cable is back."""
        self._gone = False

    def open(self) -> None:
        if self._gone:
            raise DeviceError("the emulated Omni is unplugged")
        self._open = True
        if self._start is None:
            self._start = self._clock.now()

    def read(self, timeout: float) -> bytes | None:
        """See OmniTransport."""
        self._check()
        assert self._start is not None
        limit = self._clock.now() + round(timeout * 1e9)
        while True:
            now = self._clock.now()
            behind = (now - self._start) // self._period - self._tick
            if behind > BACKLOG:  # the oldest are overwritten
                for _ in range(min(behind - BACKLOG, LONGEST_CATCH_UP)):
                    self._live()
                self._tick = (now - self._start) // self._period - BACKLOG
            due = self._start + (self._tick + 1) * self._period
            if due > limit:
                self._clock.sleep_until(limit)
                return None
            self._clock.sleep_until(due)
            self._check()  # somebody may have pulled the cable meanwhile
            self._live()
            self._tick += 1
            if self.silent:
                continue
            if self.drop > 0:
                self.drop -= 1
                continue
            if self.corrupt > 0:
                self.corrupt -= 1
                return self._report()[:-3]
            return self._report()

    def write(self, report: bytes) -> None:
        """Takes an output report; one that makes no sense changes nothing and is counted."""
        self._check()
        raw = self._out.decode(report)
        if raw is None:
            self.refused += 1
            return
        fields = self._layout.output.fields
        lit = bool(raw.get("dock_light", 0)) and self._renew is not None and self._docked_ticks > 0
        if not lit or self._on_the_way > 0 or self._tick <= self._docked_until:
            self._lit_since = None
        elif self._lit_since is None:
            self._lit_since = self._tick
        self.motors_on = bool(raw["motors_on"])
        for i, axis in enumerate(AXES):
            name = f"torque_{axis}"
            steps = raw[name] - fields[name].idle
            self.torque[i] = steps * NEWTON_METRES_PER_STEP if self.motors_on else 0.0

    def close(self) -> None:
        self._open = False

    def describe(self) -> str:
        return f"emulated Omni with the reports of layout {self._layout.name}"

    def _check(self) -> None:
        if not self._open:
            raise DeviceError("the emulated Omni is unplugged" if self._gone else "the Omni is not open")

    def _live(self) -> None:
        # The first report shows the device as it is: nothing has acted yet. In its inkwell it cannot move.
        if self._tick <= self._docked_until:
            return
        if self._lit_since is not None and self._tick >= self._lit_since + self._noticed:
            self._begin_anew()
        if self._on_the_way > 0:
            self._angles += self._step
            self._on_the_way -= 1
            if self._on_the_way == 0:
                self._docked_until = self._tick + self._docked_ticks
        else:
            self._plant.advance(self.torque)
            self._angles[:] = self._plant.sense()

    def _begin_anew(self) -> None:
        assert self._renew is not None
        self._plant = self._renew()
        self._lit_since, self._on_the_way = None, self._brought
        self._step = (self._plant.sense() - self._angles) / self._brought

    def _report(self) -> bytes:
        fields = self._layout.input.fields
        values = {"button_1": int(self.buttons[0]), "button_2": int(self.buttons[1]), "counter": self._tick}
        values["docked"] = int(self._tick < self._docked_until)
        for i, axis in enumerate(AXES):
            field = fields[f"encoder_{axis}"]
            count = round(float(self._angles[i]) / RADIANS_PER_COUNT) + START_COUNTS[i]
            values[field.name] = count % (1 << field.bits)
        if "counter" in fields:
            values["counter"] %= 1 << fields["counter"].bits
        return self._in.encode(values)
