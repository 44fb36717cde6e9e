"""Figures of merit of one stage: how well free motion and contact follow the force law's promise (thesis
4.2.3, 4.4).
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from haptic_teleop_control.robots import OMNI_JOINTS
from haptic_teleop_sysid.verification.contact import Contact, contact_merit
from haptic_teleop_sysid.verification.oscillation import Oscillation, find_oscillation
from haptic_teleop_sysid.verification.phases import Phase, find_phases
from haptic_teleop_sysid.verification.signals import StageRun

SPEED_SECONDS = 0.1
STEADY_SHARE = 0.03


@dataclass(frozen=True)
class FreeMotion:
    """Mean motor speed over the last SPEED_SECONDS of free motion, rad/s, against Td/lambda (equation 28).

    `steady`: the speed differs from that of the equal stretch before by at most STEADY_SHARE. While an arm
    accelerates, its joint is deflected, and the law lowers the speed to (Td - Te)/lambda.
    """

    start: float
    duration: float
    desired_torque: float
    speed: float
    expected_speed: float | None
    error_percent: float | None
    steady: bool


@dataclass(frozen=True)
class StageMerit:
    """All figures of a stage: `phases` as (kind, start s, end s), free motions, contacts, currents in A; or
    of an axis of the Omni as slave, with torques of its motor, N·m, for currents.
    """

    stage: str
    phases: list[tuple[str, float, float]]
    free: list[FreeMotion]
    contacts: list[Contact]
    peak_current: float
    peak_commanded_current: float | None
    current_limit: float
    share_at_limit_percent: float
    settings: dict[str, Any] = field(default_factory=dict)
    oscillation: Oscillation | None = None

    @property
    def of_omni(self) -> bool:
        """Whether it is an axis of the Omni, whose torque on the environment is only estimated."""
        return self.stage in OMNI_JOINTS

    @property
    def title(self) -> str:
        """Its name at the beginning of a sentence."""
        return self.stage.replace("stage", "Stage ").replace("omni_y", "Omni Y").replace("omni_z", "Omni Z")

    @property
    def unit(self) -> str:
        """Of `peak_current` and its limit."""
        return "N·m" if self.of_omni else "A"

    def as_json(self) -> dict[str, Any]:
        """Return everything as plain dictionaries and lists."""
        return asdict(self)


def stage_merit(run: StageRun, by_hand: bool = False) -> StageMerit:
    """Return the figures of one stage. by_hand: an operator or a simulated hand leads the master."""
    phases = find_phases(run)
    free, contacts = [], []
    for number, phase in enumerate(phases):
        if phase.kind == "free":
            found = _free_motion(run, phase)
            if found is not None:
                free.append(found)
        elif phase.kind == "contact":
            following = phases[number + 1] if number + 1 < len(phases) else None
            contacts.append(contact_merit(run, phase, following, by_hand))
    limit = run.settings.current_limit
    # The command tells best when the limit held; the measured current carries offset and noise.
    judged = run.commanded_current if run.commanded_current is not None else run.current
    commanded = None if run.commanded_current is None else float(np.nanmax(np.abs(run.commanded_current)))
    settings = {
        "lambda": run.settings.lambda_,
        "torque_gain": run.settings.torque_gain,
        "neutral": run.settings.neutral,
        "wall": run.settings.wall_angle,
        "stiffness": run.settings.stiffness,
        "torque_constant": run.settings.torque_constant,
        "current_limit": limit,
        "source": dict(run.settings.source),
        "desired_torque_from": run.desired_from,
    }
    return StageMerit(
        stage=run.stage,
        phases=[(phase.kind, *phase.seconds(run)) for phase in phases],
        free=free,
        contacts=contacts,
        peak_current=float(np.nanmax(np.abs(run.current))),
        peak_commanded_current=commanded,
        current_limit=limit,
        share_at_limit_percent=100.0 * float(np.mean(np.abs(judged) >= 0.999 * limit)),
        settings=settings,
        oscillation=find_oscillation(run, "N·m" if run.stage in OMNI_JOINTS else "A"),
    )


def _free_motion(run: StageRun, phase: Phase) -> FreeMotion | None:
    if phase.stop - phase.start < 5:
        return None
    start, end = phase.seconds(run)
    length = min(SPEED_SECONDS, 0.25 * (end - start))
    # The last sample may already have felt the wall.
    last_time = run.time[phase.stop - 2]
    inside = np.arange(len(run.time)) < phase.stop - 1
    last = inside & (run.time > last_time - length)
    before = inside & (run.time > last_time - 2.0 * length) & ~last
    desired = float(np.mean(run.desired_torque[last]))
    speed = float(np.mean(run.motor_velocity[last]))
    steady = abs(speed - float(np.mean(run.motor_velocity[before]))) <= STEADY_SHARE * abs(speed)
    expected = desired / run.settings.lambda_ if run.settings.lambda_ else None
    error = 100.0 * (speed / expected - 1.0) if expected else None
    return FreeMotion(start, end - start, desired, speed, expected, error, steady)
