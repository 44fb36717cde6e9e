"""The steps of a discovery: a line of progress for each, and the name of the one that failed; the
recordings."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from haptic_teleop_control.errors import HapticTeleopError
from haptic_teleop_sysid.discovery import campaign

STEPS = 8
Say = Callable[[str], None]
Live = Callable[[], AbstractContextManager[Say]]
"""Gives, for the time of a long step, what its lines of progress are told to."""


class StepFailed(Exception):
    """A step did not do what the next one needs; the message says which and why."""


@dataclass(frozen=True)
class Settings:
    """seed: of the draw. plant: the node of the real robot, or None: MuJoCo where it can express the drawn
    effect. mujoco: whether MuJoCo may be used. lockstep: no ROS, no clock. seconds: length of an acquisition.
    """

    seed: int
    plant: str | None
    mujoco: bool
    lockstep: bool
    seconds: float


class Steps:
    """Counts the steps, says what begins, and gives an error the name of its step."""

    def __init__(self, say: Say) -> None:
        self.say, self._number = say, 0

    @contextmanager
    def step(self, title: str) -> Iterator[None]:
        """What is done inside is the next step; its errors become StepFailed."""
        self._number += 1
        self.say(f"[{self._number}/{STEPS}] {title}")
        try:
            yield
        except (HapticTeleopError, OSError) as error:
            raise StepFailed(f"{title}: {error}") from error


def record(
    steps: Steps, settings: Settings, plant: str, folder: Path, case: Path, recording: Path
) -> None:
    """Run the parameter files in `folder` with the node `plant`: the acquisitions into the directory `case`,
    scenario 1 into `recording`. Raises StepFailed."""
    how = "in lockstep" if settings.lockstep else "in the ROS 2 graph"

    def made(what: str, run: Callable[[], int], target: Path) -> None:
        status = run()
        if status or not target.is_dir():
            raise StepFailed(f"{what} ended with exit status {status}")

    for which in campaign.ACQUISITIONS:
        with steps.step(f"acquisition for {which}, {settings.seconds:g} s open loop, {how}, by {plant}"):
            file, target = folder / f"{which}.yaml", case / which
            run = partial(campaign.run_acquisition, file, target, settings.lockstep)
            made(f"the acquisition for {which}", run, target)
    with steps.step(f"scenario 1, force control with contact, {how}, by {plant}"):
        file = folder / f"{campaign.SCENARIO_RUN}.yaml"
        run = partial(campaign.run_scenario1, file, plant, recording, settings.lockstep)
        made("scenario 1", run, recording)
