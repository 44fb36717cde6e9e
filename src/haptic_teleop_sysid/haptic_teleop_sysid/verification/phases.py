"""Idle, free motion, contact and release, found from what was measured rather than from what was planned."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sysid.verification.signals import StageRun

Array = NDArray[np.float64]
Kind = Literal["idle", "free", "contact", "release"]
COMMAND_SHARE = 0.1
"""Below this share of its greatest value the desired torque counts as none."""
HELD_SHARE = 0.5
"""In contact at rest the environment torque is at least this share of the desired torque."""
LOST_SHARE = 0.1
"""Below this share of the desired torque the contact counts as lost."""
SHORTEST = 0.1
"""s; commands and interruptions shorter than this are not phases of their own."""
NEAR_WALL = 1.5e-3
"""rad, six counts of the joint encoder: this near to where it comes to rest the arm is at the wall."""
REBOUND, STRIKE = 5.0 * NEAR_WALL, 0.1
"""rad, and s from the turn: by so much the arm is thrown back, and so long the torque of the blow lasts."""


@dataclass(frozen=True)
class Phase:
    """A span of samples, `stop` exclusive. `level` is the signed desired torque (N·m) it belongs to, 0 when
    idle.
    """

    kind: Kind
    start: int
    stop: int
    level: float = 0.0

    def seconds(self, run: StageRun) -> tuple[float, float]:
        """Start and end in s of the run's time."""
        return float(run.time[self.start]), float(run.time[min(self.stop, len(run.time) - 1)])


def find_phases(run: StageRun) -> list[Phase]:
    """Return the run's phases in order, covering every sample.

    A command is a stretch of desired torque of one sign. Its last quarter decides whether it ends in contact:
    the environment torque holds at least HELD_SHARE of the desired torque, and the arm rests or has reached
    the known wall; or the arm has been thrown back from something and has not come to rest again. The contact
    begins when the arm first comes NEAR_WALL to that resting place (or to the
    known wall); the release lasts until the torque is gone.
    """
    n = len(run.time)
    commands = _commands(run)
    phases: list[Phase] = []
    position = 0
    for number, (begin, stop, level) in enumerate(commands):
        # The torque of the contact before may outlast the onset of this command.
        start = min(max(begin, position), stop)
        if start > position:
            phases.append(Phase("idle", position, start))
        touch = _contact_start(run, start, stop, level) if stop - start > 4 else None
        position = stop
        if touch is None:
            phases.append(Phase("free", start, stop, level))
            continue
        if touch > start:
            phases.append(Phase("free", start, touch, level))
        phases.append(Phase("contact", touch, stop, level))
        end = commands[number + 1][1] if number + 1 < len(commands) else n
        gone = np.sign(level) * run.environment_torque[stop:end] < LOST_SHARE * abs(level)
        position = stop + int(np.argmax(gone)) if gone.any() else end
        if position > stop:
            phases.append(Phase("release", stop, position, level))
    if position < n:
        phases.append(Phase("idle", position, n))
    return phases


def _commands(run: StageRun) -> list[tuple[int, int, float]]:
    """Stretches of one sign as (start, stop, level), interruptions shorter than SHORTEST closed."""
    desired = run.desired_torque
    greatest = float(np.max(np.abs(desired), initial=0.0))
    if greatest < 1e-6:
        return []
    sign = np.where(np.abs(desired) > COMMAND_SHARE * greatest, np.sign(desired), 0.0)
    edges = np.flatnonzero(np.diff(sign)) + 1
    bounds = [0, *edges.tolist(), len(sign)]
    merged: list[list[float]] = []
    for a, b in pairwise(bounds):
        if sign[a] == 0.0:
            continue
        if merged and merged[-1][2] == sign[a] and run.time[a] - run.time[int(merged[-1][1]) - 1] < SHORTEST:
            merged[-1][1] = b
        else:
            merged.append([a, b, sign[a]])
    found = []
    for first, last, _ in merged:
        a, b = int(first), int(last)
        if run.time[b - 1] - run.time[a] >= SHORTEST:
            tail = slice(b - max(1, (b - a) // 4), b)
            found.append((a, b, float(np.median(desired[tail]))))
    return found


def _contact_start(run: StageRun, start: int, stop: int, level: float) -> int | None:
    sign = np.sign(level)
    tail = slice(stop - max(2, (stop - start) // 4), stop)
    arm = sign * run.arm_position[start:stop]
    if sign * np.median(run.environment_torque[tail]) < HELD_SHARE * abs(level):
        return _thrown_back(run, start, arm, sign, level)
    resting = sign * float(np.median(run.arm_position[tail]))
    seconds = run.time[tail][-1] - run.time[tail][0]
    drift = abs(float(run.arm_position[tail][-1] - run.arm_position[tail][0])) / max(seconds, 1e-9)
    reached = drift * (run.time[stop - 1] - run.time[start]) < 0.1 * max(abs(resting - arm[0]), NEAR_WALL)
    wall = run.settings.wall_angle
    at_wall = wall is not None and float(np.max(arm)) >= abs(wall) - NEAR_WALL
    if not reached and drift > 0.02:
        if wall is None or not at_wall:
            return None  # still moving: an accelerating arm, too, deflects its joint
        return start + int(np.argmax(arm >= abs(wall) - NEAR_WALL))
    place = resting - NEAR_WALL
    if wall is not None and abs(abs(wall) - resting) < 0.1:
        place = min(place, abs(wall))
    return start + int(np.argmax(arm >= place))


def _thrown_back(run: StageRun, start: int, arm: Array, sign: float, level: float) -> int | None:
    """Where the arm met what it was thrown back from, although it is pushed on: it turns at its farthest
    place, and the torque on the environment then is one of contact. None where it was not."""
    turn = int(np.argmax(arm))
    if arm[turn] - arm[turn:].min() < REBOUND:
        return None
    near = np.abs(run.time[start : start + len(arm)] - run.time[start + turn]) <= STRIKE
    if np.max(sign * run.environment_torque[start : start + len(arm)][near]) < HELD_SHARE * abs(level):
        return None
    return start + int(np.argmax(arm >= arm[turn] - NEAR_WALL))
