"""The calls of Quanser's `HIL` that the driver uses, and the way to the real one.

The manufacturer's wrapper hands buffers to C without looking at their types, so a wrong dtype is misread
silently: `board.py` makes every array once, with the type that its call needs.
"""

from __future__ import annotations

import importlib
from typing import Any, Protocol

from haptic_teleop_control.device import DeviceError
from haptic_teleop_control.errors import ConfigurationError

HARDWARE_CLOCK_0 = 0
OVERWRITE_ON_OVERFLOW = 1
TRISTATE = 2
QUADRATURE_4X = 4
"""Numbers of Quanser's `Clock`, `BufferOverflowMode`, `DigitalState` and `EncoderQuadratureMode`."""

INFINITE = 2**32 - 1
"""Samples of a task without end: the uint32 that C's -1 becomes. The wrapper refuses a negative number."""


class Hil(Protocol):
    """Channels are uint32 arrays, counts int32, volts float64, digital lines int8, digital states and
    quadrature modes int32; numbers of channels and samples are never negative.

    Once the watchdog has expired the board takes no output until `watchdog_clear`.
    """

    def open(self, card_type: str, card_identifier: str) -> None: ...
    def close(self) -> None: ...
    def is_valid(self) -> bool: ...
    def set_card_specific_options(self, options: str, size: int) -> None: ...
    def set_analog_input_ranges(self, channels: Any, n: int, minima: Any, maxima: Any) -> None: ...
    def set_analog_output_ranges(self, channels: Any, n: int, minima: Any, maxima: Any) -> None: ...
    def set_digital_directions(self, inputs: Any, n_in: int, outputs: Any, n_out: int) -> None: ...
    def set_encoder_quadrature_mode(self, channels: Any, n: int, modes: Any) -> None: ...
    def set_encoder_counts(self, channels: Any, n: int, counts: Any) -> None: ...
    def write_analog(self, channels: Any, n: int, volts: Any) -> None: ...
    def write_digital(self, channels: Any, n: int, levels: Any) -> None: ...
    def read_digital(self, channels: Any, n: int, levels: Any) -> None: ...
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
    ) -> Any: ...
    def task_set_buffer_overflow_mode(self, task: Any, mode: int) -> None: ...
    def task_get_buffer_overflows(self, task: Any) -> int: ...
    def task_start(self, task: Any, clock: int, frequency: float, samples: int) -> None: ...
    def task_read(
        self, task: Any, samples: int, analog: Any, encoder: Any, digital: Any, other: Any
    ) -> int: ...
    def task_stop(self, task: Any) -> None: ...
    def task_delete(self, task: Any) -> None: ...
    def watchdog_set_analog_expiration_state(self, channels: Any, n: int, volts: Any) -> None: ...
    def watchdog_set_digital_expiration_state(self, channels: Any, n: int, states: Any) -> None: ...
    def watchdog_start(self, timeout: float) -> None: ...
    def watchdog_stop(self) -> None: ...
    def watchdog_reload(self) -> bool: ...
    def watchdog_is_expired(self) -> bool: ...
    def watchdog_clear(self) -> None: ...


def quanser_hil() -> Hil:
    """Quanser's own `HIL`, not yet open. Raises ConfigurationError when its SDK is not installed.

    Its Python package is not on PyPI: it comes with the SDK or QUARC, as wheels beside it.
    """
    try:
        hardware = importlib.import_module("quanser.hardware")
    except ModuleNotFoundError as missing:
        if missing.name and not missing.name.startswith("quanser"):
            raise ConfigurationError(
                f"device is hardware, but Quanser's package needs the Python module {missing.name}, which is "
                "not installed; install it, or set device: emulated."
            ) from missing
        raise ConfigurationError(
            "device is hardware, but Quanser's Python package quanser.hardware is not installed; install the "
            "Quanser SDK and the quanser_api wheels of its python folder, or set device: emulated."
        ) from missing
    except OSError as missing:  # the package is there, its C library is not
        raise ConfigurationError(
            f"device is hardware, but Quanser's libraries cannot be loaded ({missing}); install the "
            "Quanser SDK, or set device: emulated."
        ) from missing
    return hardware.HIL()


def as_device_error(error: Exception, call: str) -> DeviceError:
    """`error` of an SDK call, with the manufacturer's code and sentence where it has them."""
    code = int(getattr(error, "error_code", 0) or 0)
    text = str(error)
    if hasattr(error, "get_error_message"):
        try:
            text = str(error.get_error_message())  # type: ignore[attr-defined]
        except Exception:  # the message table may be missing; the code says enough
            text = text or "no message"
    return DeviceError(f"{call}: {text or type(error).__name__} (error {code})", code)
