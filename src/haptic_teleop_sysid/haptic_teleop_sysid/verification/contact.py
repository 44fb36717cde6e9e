"""Figures of one contact: how well the torque on the environment follows what was asked for (thesis 4.2.3,
4.4)."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from haptic_teleop_sysid.verification.phases import NEAR_WALL, Phase
from haptic_teleop_sysid.verification.signals import Array, StageRun

LEFT_WALL = 2.0 * NEAR_WALL
"""rad; an arm this far from where it comes to rest has left the wall."""
SETTLED_BAND = 0.05
"""Share of the desired torque within which the contact torque counts as settled, and a hand as still."""
TIME_TO_SETTLE = 2.0
"""s; a contact that has lasted for so long and not settled does not settle."""
HELD_SECONDS = 1.0
"""A hand that asks for the same for so long holds still."""


@dataclass(frozen=True)
class Contact:
    """A contact. Times in s, torques in N·m, speeds in rad/s.

    overshoot_percent: peak of the torque above the desired torque. settling_time: from the touch until the
    torque stays within 5 % of the desired torque; None when it does not. settled_torque, settled_error (Te -
    Td), settled_rms: mean, mean and rms over the last second (or the last quarter of a shorter contact).
    bounces: how often the arm left the wall; rebound: how far at most, rad. release_time: from the
    command's end until a tenth of the torque is left.

    by_hand: a hand leads the master, so the desired torque changes during the contact and ends with the
    hand's withdrawal. held: (start, end) of the longest stretch of at least HELD_SECONDS in which it stays
    within ±5 %, or None. Where there is one, desired_torque is the mean, as the settled figures, of its last
    second (or quarter), nothing after it counts, and overshoot is the most by which the torque exceeded the
    one desired at the time, in percent of desired_torque.

    cut_off: the recording ends within TIME_TO_SETTLE of the touch, before the contact has settled.
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
    by_hand: bool = False
    held: tuple[float, float] | None = None
    cut_off: bool = False


def contact_merit(run: StageRun, phase: Phase, following: Phase | None, by_hand: bool = False) -> Contact:
    """Return the figures of `phase`, a contact; `following` is the phase after it."""
    sign = np.sign(phase.level)
    level = abs(phase.level)
    begin, stop = phase.start, phase.stop  # of the stretch at whose end it should be settled
    held = None
    if by_hand:
        # In shares of itself: the level of the phase may be that of the withdrawal.
        asked = np.log(np.maximum(sign * run.desired_torque[begin:stop], 1e-9))
        first, after = longest_still(asked, np.log((1.0 + SETTLED_BAND) / (1.0 - SETTLED_BAND)))
        still = run.time[begin + first], run.time[begin + after - 1]
        if still[1] - still[0] >= HELD_SECONDS:
            begin, stop = begin + first, begin + after
            held = float(still[0]), float(still[1])
    span = slice(phase.start, stop)
    time = run.time[span]
    torque = sign * run.environment_torque[span]
    desired = sign * run.desired_torque[span]
    length = float(time[-1] - run.time[begin])
    last = time >= time[-1] - (1.0 if length > 2.0 else 0.25 * length)
    if held is not None:
        level = abs(float(np.mean(desired[last])))
    outside = np.flatnonzero(np.abs(torque - desired) > SETTLED_BAND * level)
    settling: float | None = 0.0
    if len(outside):
        # What leaves the band in the last stretch has not settled.
        settling = None if last[outside[-1]] else float(time[outside[-1] + 1] - time[0])
    before = slice(max(0, phase.start - 5), phase.start + 1)
    error = (torque - desired)[last]
    duration = float(run.time[phase.stop - 1] - time[0])
    at_the_end = phase.stop >= len(run.time) and duration < TIME_TO_SETTLE
    released = following is not None and following.kind == "release"
    peak = float(np.max(torque))
    excess = peak - level if held is None else max(0.0, float(np.max(torque - desired)))
    arm = sign * run.arm_position[span]
    cut_off = at_the_end and settling is None and not by_hand
    resting = float(np.max(arm) if cut_off else np.median(arm[last]))  # cut off, it may be anywhere
    bounces, rebound = _rebounds(arm[int(np.argmax(arm >= resting - NEAR_WALL)) :], resting)
    return Contact(
        start=float(time[0]),
        duration=duration,
        desired_torque=float(sign * level),
        arm_position=float(np.median(run.arm_position[span][last])),
        approach_speed=float(np.mean(run.arm_velocity[before])),
        peak_torque=float(sign * peak),
        overshoot_percent=100.0 * excess / level,
        settling_time=settling,
        settled_torque=float(sign * np.mean(torque[last])),
        settled_error=float(sign * np.mean(error)),
        settled_rms=float(np.sqrt(np.mean(error**2))),
        bounces=bounces,
        rebound=rebound,
        release_time=float(np.diff(following.seconds(run))[0])
        if released and following is not None
        else None,
        by_hand=by_hand,
        held=held,
        cut_off=cut_off,
    )


def longest_still(values: Array, band: float) -> tuple[int, int]:
    """Return (first, after) of the longest stretch of `values` (n,) whose greatest and least differ by at
    most `band`; the earlier of two that are equally long."""
    best, first = (0, min(1, len(values))), 0
    high: deque[int] = deque()  # candidates for the greatest of the stretch, falling
    low: deque[int] = deque()
    listed = values.tolist()
    for k, value in enumerate(listed):
        while high and listed[high[-1]] <= value:
            high.pop()
        while low and listed[low[-1]] >= value:
            low.pop()
        high.append(k)
        low.append(k)
        while listed[high[0]] - listed[low[0]] > band:
            first = min(high[0], low[0]) + 1
            for end in (high, low):
                while end and end[0] < first:
                    end.popleft()
        if k + 1 - first > best[1] - best[0]:
            best = (first, k + 1)
    return best


def _rebounds(arm: Array, resting: float) -> tuple[int, float]:
    """Return how often an arm left its resting place at the wall by LEFT_WALL, and by how much at most,
    rad."""
    away = resting - arm
    place = np.where(away > LEFT_WALL, -1, np.where(away <= NEAR_WALL, 1, 0))
    decided = place[place != 0]
    bounces = int(np.sum((decided[:-1] == 1) & (decided[1:] == -1)))
    return bounces, float(np.max(away)) if bounces else 0.0
