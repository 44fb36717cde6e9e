"""An identification experiment on one stage or axis (thesis 3.1.1 and 3.2.1), as an object that answers
states.

2DSFJ: open loop, the signal is the motor's current in A. Omni: closed loop, the signal is a position in rad
about the place where the axis stood at the start, followed by a P-controller (gain 1 N·m/rad), because dry
friction would hold the axis otherwise. Every other stage or axis gets zero. The signal begins after a
delay, in which the robot comes to rest and from which an offset can be read later.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.parameters import Parameter, ParameterTable
from haptic_teleop_control.robots import (
    OMNI_JOINTS,
    OMNI_PEAK_TORQUE,
    SFJ_JOINTS,
    SFJ_MOTOR_JOINTS,
    SFJ_STAGES,
    STAGES,
)
from haptic_teleop_control.signals import SignalGenerator, SignalSettings, settings_from, signal_parameters
from haptic_teleop_control.signals.settings import SIGNAL_UNIT

Array = NDArray[np.float64]

CAREFUL_CURRENT = {"stage1": 0.1, "stage2": 0.2}
"""A, open loop: above, the response may be very quick (thesis 3.1.1)."""
SIGNAL = "signal"
SIGNAL_UNITS = "A, N·m or rad"
"""By `control`: of a current (2DSFJ), a torque (Omni) or a position."""
WAITING, RUNNING, FINISHED, ABORTED = "waiting", "running", "finished", "aborted"
CONTROLS = ("automatic", "open_loop", "position")


def _parameters() -> list[Parameter]:
    signal = [
        replace(entry, unit=SIGNAL_UNITS) if entry.unit == SIGNAL_UNIT else entry
        for entry in signal_parameters((SIGNAL,))
        if entry.name != "kind"
    ]
    return [
        Parameter(
            "joint", "stage1", choices=(*STAGES, *OMNI_JOINTS), meaning="the stage or axis to identify"
        ),
        Parameter(
            "control",
            "automatic",
            choices=CONTROLS,
            meaning="open_loop: the signal is a current in A (2DSFJ) or a torque in N·m (Omni); "
            "position: it is a position in rad for the P-controller; "
            "automatic: open_loop for a stage, position for an axis",
        ),
        Parameter(
            "gain", 1.0, "", 0.0, 100.0, meaning="of the P-controller: N·m/rad (Omni) or A/rad (2DSFJ)"
        ),
        Parameter("allow", False, meaning="permit currents above the recommended 0.5 A"),
        Parameter(
            "limit.position", 1.2, "rad", above=0.0, meaning="distance from the start at which it aborts"
        ),
        Parameter("limit.velocity", 20.0, "rad/s", above=0.0, meaning="speed at which it aborts"),
        Parameter(
            "limit.deflection", 0.5, "rad", above=0.0, meaning="deflection of a stage at which it aborts"
        ),
        *signal,
    ]


ACQUISITION_PARAMETERS = _parameters()
"""Parameters of the experiment; the signal's are those of the signal generator under `signal.`."""
TABLE = ParameterTable("acquisition", ACQUISITION_PARAMETERS)


class Acquisition:
    """One experiment. `step` answers each state of `robot` with the effort of all its motors.

    phase: waiting (in the delay), running, finished or aborted; sentence: why it was aborted. reference:
    the last value of the signal, `unit`; driven: the joint that it drives. warnings: what the amplitude
    guard had to say. Raises ConfigurationError for settings that contradict each other, and for a current
    that nobody should try.
    """

    def __init__(self, values: Mapping[str, Any], source: str = "parameters") -> None:
        self.values = dict(values)
        self.joint: str = values["joint"]
        self.robot = "sfj" if self.joint in STAGES else "omni"
        control = values["control"]
        self.closed = control == "position" or (control == "automatic" and self.robot == "omni")
        signal = {k: v for k, v in values.items() if k == "rate" or k.startswith(f"{SIGNAL}.")}
        self._settings = settings_from(signal, (SIGNAL,), source)
        setting = self._settings[SIGNAL]
        if not setting.enabled:
            raise ConfigurationError(f"{source}: {SIGNAL}.enabled is false: set it true, nothing would move.")
        if not math.isfinite(setting.duration):
            raise ConfigurationError(f"{source}: {SIGNAL}.duration is unlimited: state how long, in s.")
        self._generator = SignalGenerator(
            self._settings, "position" if self.closed else "effort", values["rate"]
        )
        self.joints = SFJ_JOINTS if self.robot == "sfj" else OMNI_JOINTS
        self.motors = SFJ_MOTOR_JOINTS if self.robot == "sfj" else OMNI_JOINTS
        self.driven = f"{self.joint}_motor" if self.robot == "sfj" else self.joint
        self._motor, self._out = self.joints.index(self.driven), self.motors.index(self.driven)
        self._constant = SFJ_STAGES[self.joint].torque_constant if self.robot == "sfj" else 1.0
        self._largest = SFJ_STAGES[self.joint].current_limit if self.robot == "sfj" else OMNI_PEAK_TORQUE
        self.warnings = self._guard(source)
        self.effort = np.zeros(len(self.motors))
        self.reset()

    @classmethod
    def from_parameters(cls, mapping: Mapping[str, Any], source: str = "parameters") -> Self:
        """The experiment that flat parameters describe; what is not stated keeps its default."""
        return cls(TABLE.check(mapping, source), source)

    def reset(self) -> None:
        """Before the first state again."""
        self.phase, self.sentence, self.reference = WAITING, "", 0.0
        self._home: float | None = None
        self.effort[:] = 0.0

    @property
    def unit(self) -> str:
        """Of the signal."""
        return "rad" if self.closed else ("A" if self.robot == "sfj" else "N·m")

    @property
    def published(self) -> float:
        """The last value of the signal as `/reference` has it: rad of a position, N·m of an effort."""
        return self.reference if self.closed else self._constant * self.reference

    @property
    def end(self) -> float:
        """s from the first state to the end of the signal."""
        return self._generator.end

    @property
    def settings(self) -> SignalSettings:
        """Of the signal."""
        return self._settings[SIGNAL]

    @property
    def kind(self) -> str:
        """What a recording says of the experiment."""
        how = f"position loop, gain {self.values['gain']:g}" if self.closed else "open loop"
        return f"identification of {self.joint}, {how}"

    def series(self, time: ArrayLike) -> Array:
        """The signal, `unit`, at times (n,), s since the first state; (n,)."""
        return self._generator.series(np.asarray(time, dtype=np.float64))[:, 0]

    def step(self, time: float, position: ArrayLike, velocity: ArrayLike) -> Array:
        """Answer the state at `time`, s since the first: efforts (motors,), N·m, a view; zero once it has
        ended."""
        self.effort[:] = 0.0
        if self.phase == ABORTED:
            return self.effort
        angle, rate = np.asarray(position, dtype=np.float64), np.asarray(velocity, dtype=np.float64)
        here, speed = float(angle[self._motor]), float(rate[self._motor])
        if self._home is None:
            self._home = here
        if time >= self.end:
            self.phase, self.reference = FINISHED, 0.0
            return self.effort
        self.phase = RUNNING if time >= self._settings[SIGNAL].delay else WAITING
        problem = self._beyond(here - self._home, speed, angle)
        if problem:
            self.abort(problem)
            return self.effort
        self.reference = float(self._generator.value(time)[0])
        input_ = self.values["gain"] * (self._home + self.reference - here) if self.closed else self.reference
        self.effort[self._out] = self._constant * min(max(input_, -self._largest), self._largest)
        return self.effort

    def abort(self, sentence: str) -> bool:
        """End it for good, for what `sentence` says; False where it had ended already. Every further answer
        is zero: to go on in mid-signal would be a step to full effort."""
        if self.phase in (FINISHED, ABORTED):
            return False
        self.phase, self.sentence, self.reference = ABORTED, sentence, 0.0
        self.effort[:] = 0.0
        return True

    def _beyond(self, moved: float, speed: float, position: Array) -> str:
        """A sentence when a limit is exceeded, else ""."""
        bent = abs(position[self._motor] - position[self._motor + 1]) if self.robot == "sfj" else 0.0
        for name, value, unit in (
            ("position", abs(moved), "rad"),
            ("velocity", abs(speed), "rad/s"),
            ("deflection", bent, "rad"),
        ):
            limit = self.values[f"limit.{name}"]
            # Written so that a value that is no number aborts too.
            if not value <= limit:
                return (
                    f"{self.joint} reached a {name} of {value:.3g} {unit}, beyond limit.{name} = {limit:g}: "
                    "lower the amplitude, or raise the limit if that is safe."
                )
        return ""

    def _guard(self, source: str) -> tuple[str, ...]:
        time = np.arange(0.0, self.end, 1.0 / self.values["rate"])
        peak = float(np.max(np.abs(self._generator.series(time)), initial=0.0))
        if self.robot == "omni":
            torque = peak * self.values["gain"] if self.closed else peak
            if torque <= OMNI_PEAK_TORQUE:
                return ()
            return (f"up to {torque:.2g} N·m would be asked of {self.joint}; it gives {OMNI_PEAK_TORQUE:g}",)
        facts = SFJ_STAGES[self.joint]
        current = peak * self.values["gain"] if self.closed else peak
        if current > facts.recommended_current and not self.values["allow"]:
            raise ConfigurationError(
                f"{source}: the signal asks {current:.3g} A of {self.joint}, more than the recommended "
                f"{facts.recommended_current:g} A: lower its amplitude, or say --allow (allow: true)."
            )
        careful = CAREFUL_CURRENT[self.joint]
        if current > careful:
            return (
                f"{current:.3g} A on {self.joint}: above {careful:g} A the response may be very quick; "
                "keep clear",
            )
        return ()
