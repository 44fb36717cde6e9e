"""Figures of merit of one stage: how well free motion and contact follow the force law's promise (thesis
4.2.3, 4.4).
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from haptic_teleop_control.robots import OMNI_JOINTS
from haptic_teleop_sysid.verification.phases import NEAR_WALL, Phase, find_phases
from haptic_teleop_sysid.verification.signals import Array, StageRun

SPEED_SECONDS = 0.1
STEADY_SHARE = 0.03
LEFT_WALL = 2.0 * NEAR_WALL
"""rad; an arm this far from where it comes to rest has left the wall."""
SETTLED_BAND = 0.05
"""Share of the desired torque within which the contact torque counts as settled."""


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
class Contact:
    """A contact. Times in s, torques in N·m, speeds in rad/s.

    overshoot_percent: peak of the torque above the desired torque. settling_time: from the touch until the
    torque stays within 5 % of the desired torque; None when it does not. settled_torque, settled_error (Te -
    Td), settled_rms: mean, mean and rms over the last second (or the last quarter of a shorter contact).
    bounces: how often the arm left the wall; rebound: how far at most, rad. release_time: from the
    command's end until a tenth of the torque is left.
    """

    start: float
    duration: float
    desired_torque: float
    arm_position: float
    approach_speed: float
    peak_torque: float
    overshoot_percent: float
    settling_time: float | None
    settled_torque: float
    settled_error: float
    settled_rms: float
    bounces: int
    rebound: float
    release_time: float | None


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


def stage_merit(run: StageRun) -> StageMerit:
    """Return the figures of one stage."""
    phases = find_phases(run)
    free, contacts = [], []
    for number, phase in enumerate(phases):
        if phase.kind == "free":
            found = _free_motion(run, phase)
            if found is not None:
                free.append(found)
        elif phase.kind == "contact":
            following = phases[number + 1] if number + 1 < len(phases) else None
            contacts.append(_contact(run, phase, following))
    limit = run.settings.current_limit
    # The command tells best when the limit held; the measured current carries offset and noise.
    judged = run.commanded_current if run.commanded_current is not None else run.current
    commanded = None if run.commanded_current is None else float(np.nanmax(np.abs(run.commanded_current)))
    settings = {
        "lambda": run.settings.lambda_,
        "torque_gain": run.settings.torque_gain,
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


def _contact(run: StageRun, phase: Phase, following: Phase | None) -> Contact:
    span = slice(phase.start, phase.stop)
    time = run.time[span]
    sign = np.sign(phase.level)
    level = abs(phase.level)
    torque = sign * run.environment_torque[span]
    desired = sign * run.desired_torque[span]
    duration = float(time[-1] - time[0])
    last = time >= time[-1] - (1.0 if duration > 2.0 else 0.25 * duration)
    outside = np.flatnonzero(np.abs(torque - desired) > SETTLED_BAND * level)
    settling: float | None = 0.0
    if len(outside):
        # What leaves the band in the last stretch has not settled.
        settling = None if last[outside[-1]] else float(time[outside[-1] + 1] - time[0])
    before = slice(max(0, phase.start - 5), phase.start + 1)
    error = (torque - desired)[last]
    released = following is not None and following.kind == "release"
    peak = float(np.max(torque))
    arm = sign * run.arm_position[span]
    bounces, rebound = _rebounds(
        arm[int(np.argmax(arm >= np.median(arm[last]) - NEAR_WALL)) :], float(np.median(arm[last]))
    )
    return Contact(
        start=float(time[0]),
        duration=duration,
        desired_torque=float(sign * level),
        arm_position=float(np.median(run.arm_position[span][last])),
        approach_speed=float(np.mean(run.arm_velocity[before])),
        peak_torque=float(sign * peak),
        overshoot_percent=100.0 * (peak / level - 1.0),
        settling_time=settling,
        settled_torque=float(sign * np.mean(torque[last])),
        settled_error=float(sign * np.mean(error)),
        settled_rms=float(np.sqrt(np.mean(error**2))),
        bounces=bounces,
        rebound=rebound,
        release_time=float(np.diff(following.seconds(run))[0])
        if released and following is not None
        else None,
    )


def _rebounds(arm: Array, resting: float) -> tuple[int, float]:
    """Return how often an arm left its resting place at the wall by LEFT_WALL, and by how much at most,
    rad."""
    away = resting - arm
    place = np.where(away > LEFT_WALL, -1, np.where(away <= NEAR_WALL, 1, 0))
    decided = place[place != 0]
    bounces = int(np.sum((decided[:-1] == 1) & (decided[1:] == -1)))
    return bounces, float(np.max(away)) if bounces else 0.0
