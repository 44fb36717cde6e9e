"""The driver of the 2DSFJ without ROS: a board's sample in, joint states out; efforts in, limited volts out.

It never raises while it runs. A fault is reported by name, and from then on the output is 0 V and the
amplifier off until the fault has been reset (`FAULTS` in `supervisor.py`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_2dsfj.board_settings import BoardSettings
from haptic_teleop_2dsfj.current_limiter import CurrentLimiter, LimitResult
from haptic_teleop_2dsfj.encoders import EncoderBank
from haptic_teleop_2dsfj.limit_switches import LimitSwitches
from haptic_teleop_2dsfj.link_error import LinkError
from haptic_teleop_2dsfj.settings import SfjDriverSettings
from haptic_teleop_2dsfj.supervisor import StageSupervisor
from haptic_teleop_control.device import DeviceError, EndOfSession, ReadResult, Reporter
from haptic_teleop_control.filters import VelocityFilter
from haptic_teleop_control.robots import ENCODER_COUNTS_PER_TURN

Array = NDArray[np.float64]
_MOST_LATE = 10  # samples missed at once, twice in a row


class BoardLike(Protocol):
    """What the driver needs of a board: `Board`, or a replay of one."""

    settings: BoardSettings
    counts: NDArray[np.int32]
    sense_volts: NDArray[np.float64]
    switch_levels: NDArray[np.int8]
    periods: int
    lag: float | None
    sampling: str
    enabled: bool

    @property
    def expiry(self) -> str: ...

    def open(self) -> None: ...
    def read(self) -> None: ...
    def write(self, first: float, second: float) -> None: ...
    def enable(self, on: bool) -> None: ...
    def reload_watchdog(self) -> bool: ...
    def watchdog_expired(self) -> bool: ...
    def rearm_watchdog(self) -> None: ...
    def measurements(self) -> dict[str, str]: ...
    def close(self) -> None: ...


class SfjDriver:
    """See `haptic_teleop_control.device.Driver`. Order of one sample: `read`, then `write`."""

    def __init__(
        self,
        settings: SfjDriverSettings,
        board: BoardLike,
        reporter: Reporter,
        log: Callable[[str], None] = lambda text: None,
    ) -> None:
        self.settings, self.board, self._reporter, self._log = settings, board, reporter, log
        stages = settings.stages
        turn = 2.0 * np.pi / ENCODER_COUNTS_PER_TURN
        # The order of the board's counters: both drives, then both joints.
        self.encoders = EncoderBank(
            [stage.drive_sign * turn / stage.gear_ratio for stage in stages]
            + [stage.joint_sign * turn / settings.joint_gearing for stage in stages],
            settings.board.counter_bits,
        )
        dt = settings.board.dt
        self.filter = VelocityFilter(4, dt, settings.cutoff_hz, settings.damping)
        self.filter.reset(np.zeros(4))
        self.switches = LimitSwitches(settings.limit_switches, settings.switch_debounce)
        self.limiters = [
            CurrentLimiter(i, stage, self.switches, dt, settings.ramp_time) for i, stage in enumerate(stages)
        ]
        self._supervisors = [StageSupervisor(settings.supervisor, stage, dt) for stage in stages]
        self._step, self._highest = settings.board.output_step, settings.board.highest_volts
        self.position: Array = np.zeros(4)
        self.velocity: Array = np.zeros(4)
        self.effort: Array = np.zeros(4)
        self.measured = [0.0, 0.0]
        self._flow = [0.0, 0.0]  # A, in force since the last write
        self._settling = 0  # samples since the amplifier went on, up to 2: its current needs one to show
        self._open = False
        self._late = 0
        self.missed = 0
        self.limited = self.expiries = 0

    def open(self) -> None:
        """Opens the board; the pose at this moment is the origin of all angles. Raises HapticTeleopError,
        DeviceError."""
        self.board.open()
        self._open = True
        self.encoders.reset()
        self.filter.reset(np.zeros(4))
        self.switches.start(self.board.switch_levels.tolist())
        self._check_wiring()

    def read(self) -> ReadResult:
        """Waits for the board's next sample, checks it, and fills position, velocity and effort."""
        if not self._open:
            return ReadResult.LOST
        try:
            self.board.read()
            if not self.board.reload_watchdog():
                self._expired()
        except EndOfSession:
            return ReadResult.END
        except DeviceError as error:
            self._lose(error)
            return ReadResult.LOST
        board, settings = self.board, self.settings
        self.encoders.step(board.counts.tolist())
        angle, change = self.encoders.angle, self.encoders.change
        self.position[0::2], self.position[1::2] = angle[:2], angle[2:]
        dt = settings.board.dt * board.periods
        self.velocity[:] = self.filter.step(self.position, dt if board.periods > 1 else None)
        volts = board.sense_volts.tolist()
        for i, stage in enumerate(settings.stages):
            measured = settings.amplifier.measured(volts[i]) - stage.sense_offset
            self.measured[i] = measured
            self.effort[2 * i] = measured * stage.torque_constant
            self.effort[2 * i + 1] = stage.stiffness * (angle[i] - angle[2 + i])
        self._check(change)
        if not np.isfinite(self.effort).all():
            np.nan_to_num(self.effort, copy=False, posinf=0.0, neginf=0.0)
        return ReadResult.STATE

    def write(self, effort: Array | None) -> None:
        """`effort` (2,), N·m, through all limits to the board; None or a latched fault: 0 V, power off."""
        if not self._open:
            return
        try:
            if effort is None or self._reporter.latched:
                self._rest()
                return
            amplifier = self.settings.amplifier
            volts = [0.0, 0.0]
            for i, limiter in enumerate(self.limiters):
                result = limiter.step(float(effort[i]), self.board.periods)
                if result & LimitResult.REFUSED:
                    self._stop("non_finite_command", f"stage {i + 1}: {effort[i]}")
                    return
                if result & LimitResult.OVERLOAD:
                    self._stop(
                        "overload", f"STAGE {i + 1}, {limiter.settings.overload_time:g} s at the limit"
                    )
                    return
                if result & LimitResult.LIMITED:
                    self.limited += 1
                volts[i] = amplifier.volts(
                    limiter.current, limiter.settings.current_limit, self._step, self._highest
                )
                self._flow[i] = amplifier.commanded(volts[i])
            if not self.board.enabled:
                self.board.enable(True)
                self._settling = 0
            self.board.write(*volts)
        except DeviceError as error:
            self._refused(error)

    def reset(self) -> None:
        """Rearms the watchdog and forgets suspicions; opens the board again when it was lost."""
        for supervisor in self._supervisors:
            supervisor.reset()
        self._late = 0
        try:
            if self._open:
                self._halt()
                self.board.rearm_watchdog()
                self._check_wiring()
            else:
                self.open()
        except DeviceError as error:
            self._lose(error)

    def close(self) -> None:
        """0 V, amplifier off, board released."""
        self._open = False
        self._halt()
        self.board.close()

    def describe(self) -> str:
        """Device, rate and limits in one line."""
        limits = " and ".join(f"{stage.current_limit:g} A" for stage in self.settings.stages)
        board = self.settings.board
        name = self.board.measurements().get("board", f"{board.card_type} {board.card_identifier}")
        device = f"2DSFJ on {name} at {board.rate:g} Hz, at most {limits}"
        return f"{device}; samples: {self.board.sampling}" if self.board.sampling else device

    def measurements(self) -> dict[str, Any]:
        """For diagnostics."""
        return {
            **self.board.measurements(),
            "amplifier": "on" if self.board.enabled else "off",
            "samples": self.board.sampling,
            "samples missed": self.missed,
            "watchdog expiries": self.expiries,
            "samples at the current limit": self.limited,
            "I2t used (%)": " ".join(f"{100.0 * limiter.overload.used:.0f}" for limiter in self.limiters),
            "limit switches pressed": sum(self.switches.pressed),
            "limit switch hits": sum(self.switches.hits),
            "angles (rad)": " ".join(f"{value:+.3f}" for value in self.position),
            "measured current (A)": " ".join(f"{value:+.3f}" for value in self.measured),
        }

    def _check(self, change: Array) -> None:
        periods = self.board.periods
        self.missed += periods - 1
        self._late = self._late + 1 if periods > _MOST_LATE else 0
        if self._late >= 2:
            self._stop("late", f"{periods - 1} samples missed at once, twice in a row")
        if self.board.lag is not None:
            lag, dt = self.board.lag, self.settings.board.dt
            self._stop("sample_clock", f"{abs(lag) / dt:.1f} samples too {'few' if lag > 0.0 else 'many'}")
        hit = self.switches.step(self.board.switch_levels.tolist(), self.position[1::2].tolist())
        if hit:
            self._stop(*hit)
        self._settling = min(self._settling + 1, 2)
        for i, supervisor in enumerate(self._supervisors):
            commanded = self._flow[i] if self._settling >= 2 else self.measured[i]
            problem = supervisor.step(
                commanded,
                self.measured[i],
                self.position[2 * i],
                self.position[2 * i + 1],
                change[i],
                change[2 + i],
                periods,
            )
            if problem:
                self._stop(problem[0], f"STAGE {i + 1}, {problem[1]}")

    def _check_wiring(self) -> None:
        problem = self.switches.impossible()
        if problem:
            self._reporter.fault("limit_switch_stuck", problem)

    def _expired(self) -> None:
        self.expiries += 1
        driving, why = self.board.enabled, self.board.expiry
        self._halt()
        # As long as the amplifier is off nothing can have gone wrong: the board is watched anew. It takes no
        # output before that.
        self.board.rearm_watchdog()
        if driving:
            self._stop("watchdog_expired", why)

    def _stop(self, fault: str, detail: str) -> None:
        # First the output, then the words.
        try:
            self._off()
        except DeviceError as error:
            self._refused(error)
        self._reporter.fault(fault, detail)

    def _rest(self) -> None:
        for limiter in self.limiters:
            limiter.rest(self.board.periods)
        self._off()

    def _off(self) -> None:
        self._halt()
        if self.board.enabled:
            self.board.enable(False)

    def _halt(self) -> None:
        self._flow = [0.0, 0.0]
        for limiter in self.limiters:
            limiter.halt()

    def _refused(self, error: DeviceError) -> None:
        # Between its reload and an output the watchdog may have expired: the board is there, and locked.
        try:
            if self.board.watchdog_expired():
                self._expired()
                return
        except DeviceError as further:
            error = further
        self._lose(error)

    def _lose(self, error: DeviceError) -> None:
        self.close()
        self._reporter.fault("board_link" if isinstance(error, LinkError) else "board_error", str(error))
