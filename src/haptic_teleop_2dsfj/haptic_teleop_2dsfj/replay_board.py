"""The board of a captured session: what it delivered then, it delivers again, at the same pace."""

from __future__ import annotations

import numpy as np

from haptic_teleop_2dsfj.board import READ_FORMAT
from haptic_teleop_2dsfj.board_settings import BoardSettings
from haptic_teleop_2dsfj.sample_clock import SampleClock
from haptic_teleop_control.clocks import Clock
from haptic_teleop_control.device import DeviceError
from haptic_teleop_control.replay import Session


class ReplayBoard:
    """As `Board`; nothing that is written goes anywhere."""

    def __init__(self, settings: BoardSettings, session: Session, clock: Clock) -> None:
        self.settings = settings
        self.counts = np.zeros(4, dtype=np.int32)
        self.sense_volts = np.zeros(2)
        self.switch_levels = np.ones(4, dtype=np.int8)
        self.periods = 1
        self.lag: float | None = None
        self.sampling = "of a captured session"
        self.expiry = ""
        self._sample_clock = SampleClock(settings.dt)
        self.enabled = False
        self._session, self._clock = session, clock
        self._origin: int | None = None

    def open(self) -> None:
        self._sample_clock.restart()
        self.enabled = False

    def read(self) -> None:
        """The next captured sample. Raises EndOfSession, and DeviceError for a packet that is none."""
        data = self._session.next_read()
        if data is None:
            raise DeviceError("replay: the capture holds a command without a sample before it")
        if len(data) != READ_FORMAT.size:
            raise DeviceError(f"replay: a sample of {len(data)} bytes, expected {READ_FORMAT.size}")
        values = READ_FORMAT.unpack(data)
        self.counts[:], self.sense_volts[:], self.switch_levels[:] = values[:4], values[4:6], values[6:10]
        self.periods = max(1, values[10])
        self.lag = self._sample_clock.step(values[11], self.periods)
        if self._origin is None:
            self._origin = self._clock.now() - self._session.first_stamp
        self._clock.sleep_until(self._origin + self._session.last_stamp)

    def write(self, first: float, second: float) -> None: ...

    def enable(self, on: bool) -> None:
        self.enabled = on

    def reload_watchdog(self) -> bool:
        return True

    def watchdog_expired(self) -> bool:
        return False

    def rearm_watchdog(self) -> None: ...

    def measurements(self) -> dict[str, str]:
        return {"transport": "captured session"}

    def close(self) -> None:
        self.enabled = False
