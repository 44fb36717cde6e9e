"""The HIL board with everything that this robot hangs on it: read, write, enable, watchdog.

Every array is made once with the exact type of its call. Outputs are 0 V and the amplifier disabled from
`open` on until `enable`, and again after `close`, whatever happens in between.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np

from haptic_teleop_2dsfj.board_settings import BoardSettings
from haptic_teleop_2dsfj.hil import (
    INFINITE,
    OVERWRITE_ON_OVERFLOW,
    QUADRATURE_4X,
    TRISTATE,
    Hil,
    as_device_error,
)
from haptic_teleop_2dsfj.sample_clock import SampleClock
from haptic_teleop_control.clocks import Clock, SteadyClock
from haptic_teleop_control.device import DeviceError

READ_FORMAT = struct.Struct("<4i2d4bIq")
"""A sample as captured: counts, volts of the senses, levels of the switches, periods since the last, and when
it was read, ns of the steady clock."""
WRITE_FORMAT = struct.Struct("<2d3b")
"""An output as captured: volts of the current commands, levels of the enable lines."""

QUEUE_TIME = 1.0
"""s of samples that a card keeps which does not overwrite them: a reader that comes later has lost the
board."""


SERIAL_NUMBER = "not told by HIL"
"""For who wants to know which board it is: HIL knows boards by type and identifier only."""


class Board:
    """counts (4,) int32, sense_volts (2,) float64, switch_levels (4,) int8 and `periods` after each `read`;
    lag: s, once the samples have been found not to keep step with the steady clock, otherwise None.

    make_hil: makes the `HIL`, called by `open`. on_read, on_write: take the packets' bytes, for captures.
    clock: the steady one where it is None. sampling: how the card hands out samples, in words. transport: how
    the board is reached.
    Every method raises DeviceError when the board refuses.
    """

    def __init__(
        self,
        settings: BoardSettings,
        make_hil: Callable[[], Hil],
        on_read: Callable[[bytes], None] | None = None,
        on_write: Callable[[bytes], None] | None = None,
        clock: Clock | None = None,
        transport: str = "Quanser HIL",
    ) -> None:
        self.settings, self.transport = settings, transport
        self._clock = clock or SteadyClock()
        self._sample_clock = SampleClock(settings.dt)
        self._make_hil = make_hil
        self._on_read, self._on_write = on_read, on_write
        self._hil: Hil | None = None
        self._task: Any = None
        self._encoders = np.array(settings.encoders, dtype=np.uint32)
        self._senses = np.array(settings.senses, dtype=np.uint32)
        self._outputs = np.array(settings.outputs, dtype=np.uint32)
        self._enables = np.array(settings.enables, dtype=np.uint32)
        self._switches = np.array(settings.switches, dtype=np.uint32)
        self._on = np.array(settings.enable_levels, dtype=np.int8)
        self._off = (1 - self._on).astype(np.int8)
        self._volts = np.zeros(2, dtype=np.float64)
        self._zero = np.zeros(2, dtype=np.float64)
        self.counts = np.zeros(4, dtype=np.int32)
        self.sense_volts = np.zeros(2, dtype=np.float64)
        self.switch_levels = np.ones(4, dtype=np.int8)
        self.periods = 1
        self.overflows = 0
        self.lag: float | None = None
        self.sampling = ""
        self._queues = False
        self.enabled = False

    def open(self) -> None:
        """Opens, sets ranges, directions and expiry values, zeroes the counters, starts the sampling task."""
        settings = self.settings
        self._hil = self._make_hil()
        low, high = np.full(2, -settings.range_volts), np.full(2, settings.range_volts)
        states = np.full(3, TRISTATE, dtype=np.int32)
        modes = np.full(4, QUADRATURE_4X, dtype=np.int32)
        try:
            self._call("open", settings.card_type, settings.card_identifier)
            self._clear_watchdog()  # a driver that was killed leaves an expired board behind
            if settings.options:
                self._call("set_card_specific_options", settings.options, len(settings.options))
            self._call("set_digital_directions", self._switches, 4, self._enables, 3)
            self._call("write_digital", self._enables, 3, self._off)
            self._call("set_analog_input_ranges", self._senses, 2, low, high)
            self._call("set_analog_output_ranges", self._outputs, 2, low, high)
            self._call("write_analog", self._outputs, 2, self._zero)
            self._call("set_encoder_quadrature_mode", self._encoders, 4, modes)
            self._call("set_encoder_counts", self._encoders, 4, np.zeros(4, dtype=np.int32))
            # A Q8 can only go to 0 V, and only together with its digital lines in tristate.
            self._call("watchdog_set_analog_expiration_state", self._outputs, 2, self._zero)
            self._call("watchdog_set_digital_expiration_state", self._enables, 3, states)
            self._call("read_digital", self._switches, 4, self.switch_levels)
            self._create_task()
            self._call("watchdog_start", settings.watchdog)
            self._call("task_start", self._task, settings.clock, settings.rate, INFINITE)
        except BaseException:
            self.close()
            raise
        self.overflows = 0
        self._sample_clock.restart()
        self.enabled = False

    def read(self) -> None:
        """Waits for the next sample; `periods` is 1, or more when samples were missed in between."""
        self._take()
        more = 0
        if self._queues:  # which begins with what is long past
            more = max(0, self._sample_clock.waiting(self._clock.now()) - 1)
            for _ in range(more):
                self._take()
        overflows = int(self._call("task_get_buffer_overflows", self._task))
        self.periods = 1 + more + max(0, overflows - self.overflows)
        self.overflows = overflows
        moment = self._clock.now()
        self.lag = self._sample_clock.step(moment, self.periods)
        if self._on_read is not None:
            self._on_read(
                READ_FORMAT.pack(*self.counts, *self.sense_volts, *self.switch_levels, self.periods, moment)
            )

    def write(self, first: float, second: float) -> None:
        """Volts on the outputs of stage 1 and 2."""
        self._volts[0], self._volts[1] = first, second
        self._call("write_analog", self._outputs, 2, self._volts)
        self._wrote()

    def enable(self, on: bool) -> None:
        """The amplifier on or off; either begins with 0 V."""
        self._volts[:] = 0.0
        self._call("write_analog", self._outputs, 2, self._zero)
        self._call("write_digital", self._enables, 3, self._on if on else self._off)
        self.enabled = on
        self._wrote()

    def reload_watchdog(self) -> bool:
        """False when it had expired: the board is at 0 V then, and takes no output until `rearm_watchdog`."""
        return bool(self._call("watchdog_reload"))

    def watchdog_expired(self) -> bool:
        """Whether the board has gone to 0 V by itself, which is why it refuses outputs."""
        return bool(self._call("watchdog_is_expired"))

    @property
    def expiry(self) -> str:
        """What `reload_watchdog` found, in words."""
        return f"{self.settings.watchdog:g} s without a sample's work"

    def measurements(self) -> dict[str, str]:
        """For diagnostics."""
        name = f"{self.settings.card_type} {self.settings.card_identifier}"
        return {"transport": self.transport, "board": name, "serial number": SERIAL_NUMBER}

    def rearm_watchdog(self) -> None:
        """After an expiry or a fault; ends with the amplifier off."""
        self._call("watchdog_stop")
        self._clear_watchdog()
        self.enable(False)
        self._call("watchdog_start", self.settings.watchdog)

    def close(self) -> None:
        """0 V, amplifier off, board released. Each step is tried, whatever the others did; no errors.

        Where an output was refused the watchdog is left running: the board then goes to 0 V by itself.
        """
        hil, self._hil = self._hil, None
        if hil is None:
            return
        task, self._task = self._task, None
        zeroed = _tried(hil.write_analog, self._outputs, 2, self._zero)
        disabled = _tried(hil.write_digital, self._enables, 3, self._off)
        if task is not None:
            _tried(hil.task_stop, task)
            _tried(hil.task_delete, task)
        if zeroed and disabled:
            _tried(hil.watchdog_stop)
        _tried(hil.close)
        self.enabled = False
        self._volts[:] = 0.0
        self._wrote()

    def _clear_watchdog(self) -> None:
        # A board may refuse this when nothing had expired; one that stays locked refuses the next output.
        with suppress(DeviceError):
            self._call("watchdog_clear")
        # What a board holds after that nobody has stated: perhaps what flowed before it expired. So zero
        # comes first, before its lines get a direction and a level.
        self._call("write_analog", self._outputs, 2, self._zero)

    def _create_task(self) -> None:
        self._task = self._reader(self.settings.buffer)
        try:
            self._call("task_set_buffer_overflow_mode", self._task, OVERWRITE_ON_OVERFLOW)
        except DeviceError as refusal:
            if not refusal.code:  # not the card's answer
                raise
            # As cards do by themselves, this one then ends its task when its buffer is full. So the buffer
            # becomes a queue, of which the reader takes all that has come.
            with suppress(DeviceError):
                self._call("task_delete", self._task)
            self._task = None
            self._task = self._reader(max(self.settings.buffer, math.ceil(QUEUE_TIME * self.settings.rate)))
            self._queues = True
            self.sampling = f"from a queue, because the card does not overwrite: {refusal}"
        else:
            self._queues, self.sampling = False, "the newest sample"

    def _reader(self, samples: int) -> Any:
        inputs = (self._senses, 2, self._encoders, 4, self._switches, 4)
        return self._call("task_create_reader", samples, *inputs, None, 0)

    def _take(self) -> None:
        taken = self._call(
            "task_read", self._task, 1, self.sense_volts, self.counts, self.switch_levels, None
        )
        if taken < 1:
            raise DeviceError("task_read: the board's sampling task has stopped")

    def _wrote(self) -> None:
        if self._on_write is not None:
            self._on_write(WRITE_FORMAT.pack(*self._volts, *(self._on if self.enabled else self._off)))

    def _call(self, name: str, *arguments: Any) -> Any:
        if self._hil is None:
            raise DeviceError(f"{name}: the board is not open")
        call = getattr(self._hil, name, None)
        if call is None:
            raise DeviceError(f"{name}: this Quanser SDK is too old to have it; install a newer one")
        try:
            return call(*arguments)
        except (DeviceError, TypeError, AttributeError, NameError):
            raise  # ours, or a mistake in the program, which must not pass for a fault of the board
        except Exception as error:
            # The SDK's error class exists only where the SDK does; whatever it raises, the board refused.
            raise as_device_error(error, name) from error


def _tried(step: Callable[..., Any], *arguments: Any) -> bool:
    try:
        step(*arguments)
    except Exception:  # the next step may still work, and nobody could do more
        return False
    return True
