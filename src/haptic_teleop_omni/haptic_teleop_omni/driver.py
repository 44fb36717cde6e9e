"""The driver of the Omni without ROS: reports in, joint states out; torques in, limited reports out.

It never raises while it runs. A fault is reported by name, and from then on every output report is idle with
the motors off until the fault has been reset (`FAULTS` in `settings.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.device import DeviceError, EndOfSession, ReadResult, Reporter
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.filters import VelocityFilter
from haptic_teleop_control.omni_compensation import OmniCompensation
from haptic_teleop_control.raw_capture import READ, WRITE
from haptic_teleop_omni.axis_map import IDENTITY
from haptic_teleop_omni.calibration import LIBRARY, Calibration
from haptic_teleop_omni.codec import ReportCodec, raw_of, value_of
from haptic_teleop_omni.confirmation import confirmation_file, confirmed_words
from haptic_teleop_omni.device_errors import DEVICE_LOST, LIBRARY_ERROR, device_problem
from haptic_teleop_omni.layout import ReportLayout
from haptic_teleop_omni.settings import OmniDriverSettings
from haptic_teleop_omni.torque_budget import TorqueBudget
from haptic_teleop_omni.tracking import PacketCounter, Unwrapper
from haptic_teleop_omni.transports.interface import OmniTransport

Array = NDArray[np.float64]
AXES = ("x", "y", "z")


class OmniDriver:
    """See `haptic_teleop_control.device.Driver`. on_packet: takes channel and bytes of every report."""

    def __init__(
        self,
        settings: OmniDriverSettings,
        layout: ReportLayout,
        transport: OmniTransport,
        reporter: Reporter,
        on_packet: Callable[[str, bytes], None] | None = None,
    ) -> None:
        self.settings, self.layout, self.transport = settings, layout, transport
        self._reporter, self._on_packet = reporter, on_packet
        self._in, self._out = ReportCodec(layout.input), ReportCodec(layout.output)
        self._encoders = [layout.input.fields[f"encoder_{axis}"] for axis in AXES]
        self._torques = [layout.output.fields[f"torque_{axis}"] for axis in AXES]
        self._dt = 1.0 / settings.rate
        self._absolute = layout.input.absolute
        self.axis_map = settings.axis_map if self._absolute else IDENTITY
        self._unwrapper = Unwrapper([field.bits for field in self._encoders], self._absolute)
        counter = layout.input.fields.get("counter")
        self.counter = PacketCounter(counter.bits) if counter is not None else None
        self.calibration = Calibration(
            LIBRARY if self._absolute else settings.calibration_method,
            settings.calibration_angles,
            settings.calibration_hold,
            [field.scale for field in self._encoders],
        )
        self.filter = VelocityFilter(3, self._dt, settings.cutoff_hz, settings.damping)
        self.budget = TorqueBudget(3, settings.limits)
        self.compensation = OmniCompensation(settings.compensation)
        self.may_drive = transport.emulated
        self.position: Array = np.zeros(3)
        self.velocity: Array = np.zeros(3)
        self.effort: Array = np.zeros(3)
        self.buttons = (False, False)
        self.docked = False
        self.temperature: float | None = None
        self.malformed = self.late = 0
        self._applied = [0.0, 0.0, 0.0]
        self._open = self._started = self._motors = False
        self._bad = 0
        self._elapsed = 0.0
        self._lost_origin = False  # something happened after which the calibration cannot be trusted

    def open(self) -> None:
        """Opens the device; angles are unknown until it is calibrated. Raises HapticTeleopError,
        DeviceError."""
        self.transport.open()
        self._open = True
        self._unwrapper.forget()
        self.calibration.forget()
        if self.counter is not None:
            self.counter.forget()
        self._started = self._lost_origin = False
        self._bad = 0
        try:
            self._check_confirmation()
        except BaseException:
            self.close()
            raise

    def read(self) -> ReadResult:
        """Waits for the next report, and takes the newest of those that are there."""
        if not self._open:
            return ReadResult.LOST
        self._elapsed = 0.0
        fresh = False
        try:
            report = self.transport.read(self.settings.patience)
            if report is None:
                self._elapsed = self.settings.patience
                self._fault("silent", f"{self.settings.patience:g} s")
                return ReadResult.NOTHING
            while report is not None:
                fresh = self._take(report) or fresh
                report = self.transport.read(0.0)
                self.late += report is not None
        except EndOfSession:
            if not fresh:
                return ReadResult.END
        except DeviceError as error:
            self._lose(error)
            return ReadResult.LOST
        if not fresh or not self.calibration.done:
            return ReadResult.NOTHING
        self.position[:] = self.axis_map.angles(self.calibration.angle(self._unwrapper.total))
        if not self._started:
            self.filter.reset(self.position)
            self._started = True
        self.velocity[:] = self.filter.step(self.position, self._elapsed)
        self.effort[:] = self._applied
        return ReadResult.STATE

    def write(self, effort: Array | None) -> None:
        """`effort` (3,), N·m, and the compensation of the horizontal device, through all limits to the
        device; None, a latched fault or an angle that is not known yet: idle, motors off."""
        if not self._open:
            return
        elapsed = max(self._elapsed, self._dt)
        drive = effort is not None and self.may_drive and self.calibration.done and not self._reporter.latched
        allowed = None
        if drive and effort is not None:
            wanted = effort + self.compensation.step(self.position, self.velocity, elapsed)
            # Budget and peak are the motors', which are warmed: where the map adds two axes, so is their sum.
            allowed = self.budget.step(self.axis_map.device_torque(wanted.tolist()), elapsed)
        if drive and allowed is None:
            self._reporter.fault("non_finite_command", str(effort))
        try:
            if allowed is None:
                self.budget.rest(elapsed)
                self.compensation.rest()
                self._idle()
                return
            peak = self.settings.limits.peak
            raw = [raw_of(field, value, peak) for field, value in zip(self._torques, allowed, strict=True)]
            self._send({f"torque_{axis}": word for axis, word in zip(AXES, raw, strict=True)}, True)
            flows = [value_of(field, word) for field, word in zip(self._torques, raw, strict=True)]
            self._applied = self.axis_map.axis_torque(flows)
        except DeviceError as error:
            self._lose(error)

    def reset(self) -> None:
        """Opens the device again when it was lost. After that, and after a jump of its encoders or its
        counter, the angles have to be calibrated anew."""
        self._bad = 0
        if self._lost_origin:
            self.calibration.forget()
            self._started = self._lost_origin = False
        self.budget.rest(self._dt)
        try:
            if self._open:
                self._check_confirmation()
            else:
                self.open()
        except (DeviceError, ConfigurationError) as error:
            self._lose(error)

    def close(self) -> None:
        """Idle, motors off, device released."""
        if self._open:
            with suppress(DeviceError):  # it is gone, and with it whatever it could have done
                self._idle()
        self._open = False
        self._applied = [0.0, 0.0, 0.0]
        self.transport.close()

    def describe(self) -> str:
        """Device, layout and whether torques may flow, in one line."""
        what = f"{self.transport.describe()}, layout {self.layout.name} ({self.layout.source})"
        if not self.may_drive:
            return (
                f"{what}: NOT CONFIRMED for this device, so torques are refused and nothing is sent. Run "
                "`haptic-teleop doctor --omni`, or, once angles and signs agree (docs/drivers.md), set "
                f"{self._remedy}. "
                f"Calibration: {self.calibration.advice}"
            )
        return f"{what}, at most {self.settings.limits.peak:g} N·m. Calibration: {self.calibration.advice}"

    def measurements(self) -> dict[str, Any]:
        """For diagnostics."""
        counter, unconfirmed = self.counter, f"refused until `haptic-teleop doctor --omni`, or {self._remedy}"
        return {
            "transport": self.transport.name,
            "serial number": self.transport.serial or "not told",
            "torque output": "possible" if self.may_drive else unconfirmed,
            "calibration": "done" if self.calibration.done else self.calibration.advice,
            "docked": self.docked,
            "buttons": " ".join(str(int(button)) for button in self.buttons),
            "motors": "on" if self._motors else "off",
            "motor temperature": "unknown" if self.temperature is None else f"{self.temperature:.2f} of 1",
            "reports lost": 0 if counter is None else counter.lost,
            "reports repeated": 0 if counter is None else counter.repeated,
            "reports out of date": 0 if counter is None else counter.stale,
            "reports malformed": self.malformed,
            "reports overtaken": self.late,
            "samples at a torque limit": self.budget.limited,
            "weakened axes": " ".join(
                f"omni_{a}" for a, on in zip(AXES, self.budget.weakened, strict=True) if on
            ),
        }

    @property
    def _remedy(self) -> str:
        return f'layout_confirmed_for: "{self.confirmation}"'

    @property
    def confirmation(self) -> str:
        """What has to be confirmed before a torque flows: device, layout and, where there is one, axis
        map."""
        words = self.layout.confirmation(self.transport.identity)
        return f"{words} {self.axis_map.digest}" if self._absolute else words

    def _check_confirmation(self) -> None:
        if self.transport.emulated:
            self.may_drive = True
            return
        identity, stated = self.transport.identity, self.settings.layout_confirmed_for
        # Without a serial number it may be any device of the model: then somebody has to say so in the file.
        if not stated and (self.transport.serial or not self._absolute):
            stated = confirmed_words(confirmation_file(self.settings.confirmations), identity)
        self.may_drive = bool(identity) and stated == self.confirmation
        if stated and not self.may_drive:
            detail = f'it is "{stated}", this device needs {self._remedy}'
            self._reporter.fault("layout_not_confirmed", detail)

    def _take(self, report: bytes) -> bool:
        """One report; False for one that cannot be used."""
        if self._on_packet is not None:
            self._on_packet(READ, report)
        raw = self._in.decode(report)
        if raw is None:
            self.malformed += 1
            self._suspect("malformed_report", f"{self._in.problem}, {len(report)} bytes")
            return False
        periods = 1 if self.counter is None else self.counter.step(raw["counter"])
        if periods == 0:
            self._suspect("frozen_counter", f"counter {raw['counter']}")
            return False
        self._bad = 0
        if periods < 0:
            self._lost_origin = True
            self._fault("counter_restart", f"counter {raw['counter']}")
        elapsed = abs(periods) * self._dt
        self._elapsed += elapsed
        if not self._healthy(raw):
            return False
        known = bool(raw.get("calibrated", 0))
        if self._absolute and not self.calibration.done:
            self._unwrapper.forget()  # when the library learns the angles they jump, and nobody moves
        changes = self._unwrapper.step([raw[field.name] for field in self._encoders])
        speeds = [abs(n * f.scale) / elapsed for n, f in zip(changes, self._encoders, strict=True)]
        fastest = max(speeds)
        if fastest > self.settings.highest_speed:
            self._lost_origin = True
            self._fault("over_speed", f"omni_{AXES[speeds.index(fastest)]} at {fastest:.0f} rad/s")
        self.buttons = (bool(raw.get("button_1", 0)), bool(raw.get("button_2", 0)))
        self.docked = bool(raw.get("docked", 0))
        self.calibration.step(self._unwrapper.total, self.docked, self.buttons[0], elapsed, known)
        if self._absolute and self.calibration.done and not known:
            self._lost_origin = True
            self._fault("calibration_lost", "")
        return True

    def _healthy(self, raw: Mapping[str, int]) -> bool:
        """What a report says of its device; False where its angles mean nothing. Raises DeviceError where it
        says that the device is lost."""
        if "temperature" in raw:
            self.temperature = value_of(self.layout.input.fields["temperature"], raw["temperature"])
        code = raw.get("error", 0)
        if not code:
            return True
        problem = device_problem(code, raw.get("internal_error", 0))
        if problem.fault == DEVICE_LOST:
            raise DeviceError(problem.text, code)
        self._fault(problem.fault, problem.text)
        return problem.fault != LIBRARY_ERROR

    def _suspect(self, fault: str, detail: str) -> None:
        self._bad += 1
        if self._bad >= self.settings.bad_reports:
            self._fault(fault, detail)

    def _fault(self, fault: str, detail: str) -> None:
        # First the output, then the words.
        try:
            self._idle()
        except DeviceError as error:
            self._lose(error)
        self._reporter.fault(fault, detail)

    def _idle(self) -> None:
        self._applied = [0.0, 0.0, 0.0]
        inkwell = self.calibration.method == "dock" and not self.calibration.done
        self._send({"dock_light": int(inkwell)}, False)

    def _send(self, values: dict[str, int], motors: bool) -> None:
        if not self.may_drive:
            return  # bytes of an unknown meaning are not sent at all
        report = self._out.encode({**values, "motors_on": int(motors)})
        self._motors = motors
        if self._on_packet is not None:
            self._on_packet(WRITE, report)
        self.transport.write(report)

    def _lose(self, error: Exception) -> None:
        self._open = self._motors = False
        self._applied = [0.0, 0.0, 0.0]
        self.transport.close()
        self._reporter.fault("device_lost", str(error))
