"""Any Omni or Touch through the vendor's HD library, paced by that library's own servo thread.

`callback` schedules the compiled frame (`hd_frame.py`) for every period; this side waits for its reports.
`synchronous` asks for one frame at a time and waits in the library until its servo thread has done it; then
nothing takes the torque away when this side stops asking.

A torque that is written acts from the next period on. Force is off until the first report with the motors on,
and it goes off in the library, not only to zero, whenever the motors do.
"""

from __future__ import annotations

import atexit
import ctypes
import threading
import time
from dataclasses import dataclass
from typing import Any

from haptic_teleop_control.device import DeviceError
from haptic_teleop_control.quantities import check_quantities, quantity
from haptic_teleop_omni.transports import hd_frame as frame
from haptic_teleop_omni.transports import hd_library as hd
from haptic_teleop_omni.transports.hd_device import HdDevice, open_device
from haptic_teleop_omni.transports.hd_exchange import Exchange

PACINGS = ("callback", "synchronous")
PRIORITY = 0xFFFF // 2
OPENING_TIME = 2.0
"""s in which the servo thread has to bring its first report."""

CLOSING_TIME = 0.1
"""s that the servo thread has to take the torque away before the library is told to stop without it."""

PAUSING_TIME = 0.02
"""s that the servo thread has to do so before it is stopped for another device."""

_lock = threading.Lock()


@dataclass(frozen=True)
class OpenHapticsSettings:
    """Raises ConfigurationError naming the field for a value outside its range."""

    library: str = quantity(
        "", "", "libHD.so: an absolute path, or a name for the system's loader; empty: find it"
    )
    device_name: str = quantity(
        "", "", "of the vendor's set-up tool; empty: Default Device, then Default PHANToM"
    )
    serial: str = quantity("", "", "serial number that the device must have; empty: any")
    pacing: str = quantity("callback", "", "how the servo thread paces the driver", choices=PACINGS)
    watchdog: float = quantity(
        0.02,
        "s",
        "time without a new torque after which the callback sets it to zero",
        minimum=0.005,
        maximum=0.2,
    )
    inkwell_value: int = quantity(
        0, "", "of the library's inkwell switch with the stylus in it", minimum=0, maximum=1
    )

    def __post_init__(self) -> None:
        check_quantities(self)


class OpenHapticsTransport:
    """identity: model and serial number of the device that was opened. clock_gettime: for tests, a function
    of ctypes in place of the system's. Raises ConfigurationError without the library."""

    name = "openhaptics"
    emulated = False

    def __init__(self, settings: OpenHapticsSettings, clock_gettime: Any = None) -> None:
        self.settings = settings
        self._hd = hd.load_library(settings.library)
        # Compiles: in a driver's loop it would be too late.
        self._frame = frame.frame_of(self._hd, clock_gettime)
        self._callback = ctypes.cast(self._frame.address, hd.CALLBACK)
        self.identity = self.serial = self._versions = ""
        self._handle: int | None = None
        self._schedule: int | None = None
        self._exchange = Exchange()
        self._words = self._exchange.words

    def open(self) -> None:
        """Raises ConfigurationError for another serial number than the stated one, DeviceError when the
        device cannot be opened, with what helps."""
        self.close()
        with _lock:
            self._pause_scheduler()
            try:
                device = self._init_device()
                self._handle, self.identity, self.serial, version, _ = device
                self._versions = f", driver {version}" if version else ""
                self._hd.opened.append(self)
            finally:
                if self._hd.opened:
                    self._hd.start_scheduler()
        atexit.register(self.close)
        try:
            self._schedule_frame(device)
            self._await_report()
        except BaseException:
            self.close()
            raise

    def read(self, timeout: float) -> bytes | None:
        """See OmniTransport; the system waits in whole milliseconds."""
        if self._handle is None:
            raise DeviceError("the HD device is not open")
        if self._exchange.waiting == 0 and timeout > 0.0:
            left, limit = timeout, time.monotonic() + timeout
            # The device is asked at least once: this process may have stood still, and not the device.
            while self._exchange.waiting == 0 and left > 0.0:
                self._wait(left)
                left = limit - time.monotonic()
        return self._exchange.take()

    def write(self, report: bytes) -> None:
        """Gives the torques of an output report to the next period."""
        if self._handle is None:
            raise DeviceError("the HD device is not open")
        self._exchange.give(report)

    def close(self) -> None:
        """Torque to zero and force off in the servo thread, then from here, then the device is released."""
        with _lock:
            handle, self._handle = self._handle, None
            if handle is None:
                return
            atexit.unregister(self.close)
            library = self._hd
            self._words[frame.CLOSING] = 1
            if self._schedule is None:  # asked frame by frame: this one waits for no thread that hangs
                self._schedule = self._enter_callback()
            self._await_end()
            if not self._words[frame.CLOSED]:  # it hangs: from here, whatever the library says to that
                self._force_off(handle)
                library.hdUnschedule(self._schedule)
            self._schedule = None
            library.opened.remove(self)
            library.stop_scheduler()
            self._force_off(handle)
            library.hdDisableDevice(handle)
            if library.opened:
                library.start_scheduler()
            library.error()
            self._exchange.end()

    def _enter_callback(self) -> int:
        return int(self._hd.hdScheduleAsynchronous(self._callback, self._exchange.address, PRIORITY))

    def _force_off(self, handle: int) -> None:
        self._hd.hdMakeCurrentDevice(handle)
        self._hd.hdDisable(hd.FORCE_OUTPUT)

    def restarted(self) -> None:
        """The servo thread is about to start: its first frames may be errors, and count for nothing."""
        self._words[frame.CLEAN] = self._words[frame.FORGIVEN] = self._words[frame.PAUSED] = 0

    def pause(self) -> None:
        """The servo thread is about to stop: its next frame takes the torque away; waits for that."""
        self._words[frame.PAUSED] = 1
        limit = time.monotonic() + PAUSING_TIME
        while self._words[frame.ENABLED] and time.monotonic() < limit:
            time.sleep(0.001)

    def paused(self) -> None:
        """The servo thread stands: the force is off, also where no frame came any more."""
        if self._words[frame.ENABLED] and self._handle is not None:
            self._force_off(self._handle)
            self._words[frame.ENABLED] = 0

    def describe(self) -> str:
        device = self.identity or "HD device"
        return f"{device} through {self._hd.path}{self._versions}, {self.settings.pacing}"

    def _init_device(self) -> HdDevice:
        return open_device(self._hd, self.settings.device_name, self.settings.serial)

    def _schedule_frame(self, device: HdDevice) -> None:
        settings, single = self.settings, self.settings.pacing == "synchronous"
        self._exchange.begin(device.handle, device.style, settings.inkwell_value, settings.watchdog, single)
        if not single:
            self._schedule = self._enter_callback()

    def _await_report(self) -> None:
        """Until the first frames are through, which may be errors."""
        limit = time.monotonic() + OPENING_TIME
        while self._exchange.waiting == 0:
            self._wait(0.01)
            if time.monotonic() > limit:
                self._hd.check("the library's servo thread brings no frame")
                raise DeviceError(
                    "the library's servo thread runs no callback; end what else uses the device"
                )

    def _wait(self, timeout: float) -> None:
        """For a report, up to `timeout` s, in whole milliseconds."""
        if self.settings.pacing == "synchronous":
            self._hd.hdScheduleSynchronous(self._callback, self._exchange.address, PRIORITY)
        self._exchange.sleep(timeout if self.settings.pacing == "callback" else 0.0)

    def _await_end(self) -> None:
        limit = time.monotonic() + CLOSING_TIME
        while not self._words[frame.CLOSED] and (left := limit - time.monotonic()) > 0.0:
            self._exchange.sleep(left)

    def _pause_scheduler(self) -> None:
        # A second device of this process joins: the library wants its devices before its scheduler runs.
        if self._hd.opened:
            self._hd.stop_scheduler()
