"""A Q8 board that is not there: the very calls of `HIL`, with a simulated robot at its connectors.

It has the board's limits: 14-bit inputs, 12-bit outputs, 24-bit counters, a sampling task that paces its
reader, a watchdog that goes to 0 V and tristate, and the amplifier with its enable lines behind it. Buffers
of a wrong type are refused with an error, where the real wrapper would misread them silently.

What a period's output does acts over the whole period, as in the simulated plants.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_2dsfj.board_settings import BoardSettings
from haptic_teleop_2dsfj.emulated_electronics import Electronics
from haptic_teleop_2dsfj.hil import OVERWRITE_ON_OVERFLOW, QUADRATURE_4X, TRISTATE
from haptic_teleop_control.clocks import Clock

LONGEST_CATCH_UP = 500  # samples of the plant that are made up for after a stall; the rest is lost
NOT_OPEN, BAD_ARGUMENT, EXPIRED, NO_DEVICE, OVERFLOW = -1, -2, -3, -4, -5
RANGES = (5.0, 10.0)
"""V either side, that the analog lines know; the last one after power-up."""
CARDS = ("q8", "q8_usb")
"""Types of cards that are emulated."""
LOCKED = ("write_", "set_")
"""Beginnings of the calls that an expired board refuses until its watchdog has been cleared."""


EXCHANGE = {"normal": 1e-3, "fast": 125e-6}
"""s that a call over USB waits for its exchange. The vendor states the rates, 1 kHz and 8 kHz (a frame and a
microframe of USB), for the Q8-USB's option update_rate; that each call takes one is the worst case."""
PCI_CALL = 10e-6
"""s of a call over PCI: some registers of about 1 µs each; the vendor states no figure."""
FREE = ("task_get_buffer_overflows", "is_valid", "open", "close")
"""Calls that need no exchange, or are not part of a loop."""


class EmulatedError(Exception):
    """As the SDK's HILError: a code and a message. The codes are the emulation's own."""

    def __init__(self, error_code: int, message: str) -> None:
        super().__init__(message)
        self.error_code = error_code

    def get_error_message(self) -> str:
        return str(self.args[0])


class SfjPlant(Protocol):
    """The robot at the connectors. Order of a sample: `sense`, then `advance` with what acts from then."""

    def sense(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Angles (4,), rad, in the order of the joints, and currents (2,), A, as the sensors give them."""
        ...

    def advance(self, current: NDArray[np.float64]) -> None:
        """One sample with `current` (2,), A, counter-clockwise positive."""


class EmulatedHil:
    """See the module. unplug(): every call fails from then on; refuse(call, code): that call fails once;
    stuck: level of a switch (0 to 3) whatever the arm does, or no entry; lose(n): samples get lost and no
    overflow is counted; stretch: of the period, where its clock is wrong. clock: the one asked for.

    Of `settings` it takes the channels: each line is plugged in where the driver looks for it. All scales
    are those of `electronics`, and the ranges those that the calls set. Each call costs its time on the bus,
    PCI or USB as `board.type` says; it is paid before the next sample can be read, so that a loop which is
    too slow for its rate misses samples."""

    def __init__(
        self,
        plant: SfjPlant,
        settings: BoardSettings,
        clock: Clock,
        switch_angle: float = 1.45,
        electronics: Electronics | None = None,
    ) -> None:
        self._plant, self._wiring, self._clock = plant, settings, clock
        self._electronics = electronics or Electronics()
        self._switch_angle = switch_angle
        self._counts_per_rad = self._electronics.counts_per_radian
        self._input_range = self._output_range = RANGES[-1]
        self.stuck: dict[int, int] = {}
        self.volts = np.zeros(2)
        self.levels = np.ones(3, dtype=np.int8)
        self.current = np.zeros(2)
        """A, that the amplifier gave over the last period."""
        self.opened = self.expired = self.tristate = False
        self.calls: list[str] = []
        self._gone = False
        self._refusals: dict[str, int] = {}
        self._offset = np.array([7, -3, 11, -5], dtype=np.int64)  # counters hold anything at power-up
        self._angles, self._sensed = np.zeros(4), np.zeros(2)
        self._timeout = 0
        self._reloaded: int | None = None
        self._period = 0
        self._tick = self._start = 0
        self._overflows = self._lost = 0
        self._buffer, self._overwrites = 1, False
        self._held = np.zeros(2)
        self._usb = settings.card_type.endswith("_usb")
        self._cost = self._cost_of_a_call("normal")
        self._owed = 0
        self.stretch, self.clock = 1.0, 0
        self._look()

    # What a test does to it.

    def unplug(self) -> None:
        """The cable is pulled."""
        self._gone = True

    def plug(self) -> None:
        """The cable is back; the board has forgotten everything."""
        self._gone = False
        self.opened = self.expired = self.tristate = False
        self._reloaded = None
        self.volts[:] = 0.0
        self.levels[:] = 1  # lines float high at power-up: both stages disabled

    def refuse(self, call: str, code: int) -> None:
        """The next `call` fails with `code`."""
        self._refusals[call] = code

    def lose(self, samples: int) -> None:
        """So many samples are never taken, and nobody is told."""
        self._lost += samples

    # The calls of HIL.

    def open(self, card_type: str, card_identifier: str) -> None:
        self._enter("open", needs_open=False)
        if card_type not in CARDS:
            raise EmulatedError(BAD_ARGUMENT, f"no card of type {card_type}; there are {', '.join(CARDS)}")
        self._is_expired()  # the watchdog runs in the board, whatever became of who started it
        self.opened = True

    def close(self) -> None:
        self._enter("close")
        self.opened = False

    def is_valid(self) -> bool:
        return self.opened

    def set_card_specific_options(self, options: str, size: int) -> None:
        self._enter("set_card_specific_options")
        parts = (part.partition("=") for part in options[:size].split(";") if part)
        stated = {name: value for name, _, value in parts}
        rate = stated.pop("update_rate", "normal")
        if not self._usb or stated or rate not in EXCHANGE:
            raise EmulatedError(BAD_ARGUMENT, f"the emulated board has no option {options!r}")
        self._cost = self._cost_of_a_call(rate)

    def set_analog_input_ranges(self, channels: Any, n: int, minima: Any, maxima: Any) -> None:
        self._enter("set_analog_input_ranges")
        self._types(
            channels=(channels, np.uint32, n), minima=(minima, np.float64, n), maxima=(maxima, np.float64, n)
        )
        self._input_range = self._range(minima, maxima)

    def set_analog_output_ranges(self, channels: Any, n: int, minima: Any, maxima: Any) -> None:
        self._enter("set_analog_output_ranges")
        self._types(
            channels=(channels, np.uint32, n), minima=(minima, np.float64, n), maxima=(maxima, np.float64, n)
        )
        self._output_range = self._range(minima, maxima)

    def set_digital_directions(self, inputs: Any, n_in: int, outputs: Any, n_out: int) -> None:
        self._enter("set_digital_directions")
        self._types(inputs=(inputs, np.uint32, n_in), outputs=(outputs, np.uint32, n_out))

    def set_encoder_quadrature_mode(self, channels: Any, n: int, modes: Any) -> None:
        self._enter("set_encoder_quadrature_mode")
        self._types(channels=(channels, np.uint32, n), modes=(modes, np.int32, n))
        if np.any(modes != QUADRATURE_4X):
            raise EmulatedError(BAD_ARGUMENT, "the emulated encoders count four edges per line")

    def set_encoder_counts(self, channels: Any, n: int, counts: Any) -> None:
        self._enter("set_encoder_counts")
        self._types(channels=(channels, np.uint32, n), counts=(counts, np.int32, n))
        for channel, count in zip(channels.tolist(), counts.tolist(), strict=True):
            i = self._wiring.encoders.index(channel)
            self._offset[i] = count - round(self._angles[self._joint(i)] * self._counts_per_rad[i])

    def write_analog(self, channels: Any, n: int, volts: Any) -> None:
        self._enter("write_analog")
        self._types(channels=(channels, np.uint32, n), volts=(volts, np.float64, n))
        full, top = self._output_range, 2**self._electronics.output_bits - 1
        step = 2.0 * full / (top + 1)
        for channel, value in zip(channels.tolist(), volts.tolist(), strict=True):
            if not np.isfinite(value):
                raise EmulatedError(BAD_ARGUMENT, "an output voltage is not finite")
            code = min(max(round((value + full) / step), 0), top)
            self.volts[self._wiring.outputs.index(channel)] = code * step - full

    def write_digital(self, channels: Any, n: int, levels: Any) -> None:
        self._enter("write_digital")
        self._types(channels=(channels, np.uint32, n), levels=(levels, np.int8, n))
        for channel, level in zip(channels.tolist(), levels.tolist(), strict=True):
            self.levels[self._wiring.enables.index(channel)] = level

    def read_digital(self, channels: Any, n: int, levels: Any) -> None:
        self._enter("read_digital")
        self._types(channels=(channels, np.uint32, n), levels=(levels, np.int8, n))
        for i, channel in enumerate(channels.tolist()):
            levels[i] = self._switch(self._wiring.switches.index(channel))

    def task_create_reader(
        self,
        samples: int,
        analog: Any,
        n_analog: int,
        encoder: Any,
        n_encoder: int,
        digital: Any,
        n_digital: int,
        other: Any,
        n_other: int,
    ) -> Mapping[str, list[int]]:
        self._enter("task_create_reader")
        self._types(
            analog=(analog, np.uint32, n_analog),
            encoder=(encoder, np.uint32, n_encoder),
            digital=(digital, np.uint32, n_digital),
        )
        self._buffer, self._overwrites = samples, False  # a card ends its task unless it is told to overwrite
        return {
            "analog": [self._wiring.senses.index(channel) for channel in analog.tolist()],
            "encoder": [self._wiring.encoders.index(channel) for channel in encoder.tolist()],
            "digital": [self._wiring.switches.index(channel) for channel in digital.tolist()],
        }

    def task_set_buffer_overflow_mode(self, task: Any, mode: int) -> None:
        self._enter("task_set_buffer_overflow_mode")
        self._overwrites = mode == OVERWRITE_ON_OVERFLOW

    def task_get_buffer_overflows(self, task: Any) -> int:
        self._enter("task_get_buffer_overflows")
        return self._overflows

    def task_start(self, task: Any, clock: int, frequency: float, samples: int) -> None:
        self._enter("task_start")
        if not 0 <= samples < 2**32:  # as cffi does, before anything reaches the library
            raise OverflowError("can't convert negative number to unsigned")
        self.clock = clock
        self._period = round(1e9 / frequency * self.stretch)
        self._start, self._tick, self._overflows, self._owed = self._clock.now(), 0, 0, 0

    def task_read(
        self, task: Mapping[str, list[int]], samples: int, analog: Any, encoder: Any, digital: Any, other: Any
    ) -> int:
        """Waits for the next sample. A late reader gets the newest one, the others are overflows; where
        nothing is overwritten he gets the oldest, until the buffer is full, which ends the task."""
        self._enter("task_read")
        self._types(
            analog=(analog, np.float64, 2), encoder=(encoder, np.int32, 4), digital=(digital, np.int8, 4)
        )
        if not self._period:
            return 0
        lost, self._lost = self._lost, 0
        due = self._start + (self._tick + 1 + lost) * self._period
        owed, self._owed = self._owed, 0
        if self._clock.now() + owed > due:
            self._clock.sleep_until(self._clock.now() + owed)
        late = max(0, (self._clock.now() - due) // self._period)
        if not self._overwrites:
            if late >= self._buffer:
                self._period = 0
                raise EmulatedError(OVERFLOW, "the buffer of the task is full")
            late = 0
        self._overflows += late
        self._pass(1 + late + lost)
        self._clock.sleep_until(due)
        if self._gone:
            raise EmulatedError(NO_DEVICE, "the board does not respond")
        full = self._input_range
        step = 2.0 * full / 2**self._electronics.input_bits
        for i, sense in enumerate(task["analog"]):
            volts = self._sensed[sense] * self._electronics.sense_volts_per_ampere
            if np.isfinite(volts):  # what is not stays so, for tests of what a driver does then
                volts = min(max(round(volts / step) * step, -full), full)
            analog[i] = volts
        span = 1 << self._electronics.counter_bits
        for i, counter in enumerate(task["encoder"]):
            count = round(self._angles[self._joint(counter)] * self._counts_per_rad[counter])
            encoder[i] = (count + self._offset[counter] + span // 2) % span - span // 2
        for i, switch in enumerate(task["digital"]):
            digital[i] = self._switch(switch)
        return 1

    def task_stop(self, task: Any) -> None:
        self._enter("task_stop")
        self._period = 0

    def task_delete(self, task: Any) -> None:
        self._enter("task_delete")

    def watchdog_set_analog_expiration_state(self, channels: Any, n: int, volts: Any) -> None:
        self._enter("watchdog_set_analog_expiration_state")
        self._types(channels=(channels, np.uint32, n), volts=(volts, np.float64, n))
        if np.any(volts):
            raise EmulatedError(BAD_ARGUMENT, "a Q8 can only expire to 0 V")

    def watchdog_set_digital_expiration_state(self, channels: Any, n: int, states: Any) -> None:
        self._enter("watchdog_set_digital_expiration_state")
        self._types(channels=(channels, np.uint32, n), states=(states, np.int32, n))
        if np.any(states != TRISTATE):
            raise EmulatedError(BAD_ARGUMENT, "a Q8 can only expire to tristate")

    def watchdog_start(self, timeout: float) -> None:
        self._enter("watchdog_start")
        self._timeout = round(timeout * 1e9)
        self._reloaded = self._clock.now()

    def watchdog_stop(self) -> None:
        self._enter("watchdog_stop")
        self._is_expired()
        self._reloaded = None

    def watchdog_reload(self) -> bool:
        self._enter("watchdog_reload")
        if self._is_expired():
            return False
        if self._reloaded is not None:
            self._reloaded = self._clock.now()
        return True

    def watchdog_clear(self) -> None:
        self._enter("watchdog_clear")
        if not self._is_expired():
            raise EmulatedError(BAD_ARGUMENT, "there is nothing to clear")
        self.expired = self.tristate = False
        self.volts[:] = self._held  # nobody has stated what a board does here: the worst that it could do

    def watchdog_is_expired(self) -> bool:
        self._enter("watchdog_is_expired")
        return self._is_expired()

    # Inside.

    @property
    def amplifier_on(self) -> tuple[bool, bool]:
        """Per stage: its enable line low, the master line high, and nothing in tristate. Lines keep their
        levels when the board is released."""
        master = self.levels[2] == 1 and not self.tristate
        return bool(master and self.levels[0] == 0), bool(master and self.levels[1] == 0)

    def _cost_of_a_call(self, update_rate: str) -> int:
        return round(1e9 * (EXCHANGE[update_rate] if self._usb else PCI_CALL))

    def _enter(self, call: str, needs_open: bool = True) -> None:
        self._owed += 0 if call in FREE else self._cost
        self.calls.append(call)
        del self.calls[:-200]
        if self._gone:
            raise EmulatedError(NO_DEVICE, "the board does not respond")
        if call in self._refusals:
            raise EmulatedError(self._refusals.pop(call), f"{call} was refused")
        if needs_open and not self.opened:
            raise EmulatedError(NOT_OPEN, f"{call}: the board is not open")
        if call.startswith(LOCKED) and self._is_expired():
            raise EmulatedError(EXPIRED, f"{call}: the watchdog has expired")

    @staticmethod
    def _types(**buffers: tuple[Any, Any, int]) -> None:
        for name, (buffer, dtype, size) in buffers.items():
            if not isinstance(buffer, np.ndarray) or buffer.dtype != dtype or buffer.shape != (size,):
                wanted = np.dtype(dtype).name
                raise EmulatedError(BAD_ARGUMENT, f"{name} must be {size} values of type {wanted}")

    def _is_expired(self, moment: int | None = None) -> bool:
        now = self._clock.now() if moment is None else moment
        if self._reloaded is not None and now - self._reloaded > self._timeout:
            self._reloaded = None
            self.expired = self.tristate = True
            self._held[:] = self.volts
            self.volts[:] = 0.0
        return self.expired

    def _pass(self, periods: int) -> None:
        """The time until the next sample: the plant moves on with what the outputs give in each period."""
        for k in range(periods):
            self._is_expired(self._start + self._tick * self._period)
            for i, on in enumerate(self.amplifier_on):
                flows = on and not self._gone
                self.current[i] = self.volts[i] * self._electronics.amperes_per_volt if flows else 0.0
            # The first sample shows the plant as it is: it has not been driven yet.
            if self._tick > 0 and k < LONGEST_CATCH_UP:
                self._plant.advance(self.current)
                self._look()
            self._tick += 1

    def _look(self) -> None:
        angles, currents = self._plant.sense()
        self._angles[:], self._sensed[:] = angles, currents

    @staticmethod
    def _range(minima: Any, maxima: Any) -> float:
        full = float(maxima[0])
        if full not in RANGES or np.any(maxima != full) or np.any(minima != -full):
            raise EmulatedError(BAD_ARGUMENT, f"its ranges are ±{RANGES[0]:g} and ±{RANGES[1]:g} V")
        return full

    @staticmethod
    def _joint(counter: int) -> int:
        # Counters: drive 1, drive 2, joint 1, joint 2; joints: motor 1, arm 1, motor 2, arm 2.
        return (0, 2, 1, 3)[counter]

    def _switch(self, switch: int) -> int:
        if switch in self.stuck:
            return self.stuck[switch]
        arm = self._angles[1 + 2 * (switch // 2)]
        beyond = arm >= self._switch_angle if switch % 2 == 0 else arm <= -self._switch_angle
        return 0 if beyond else 1
