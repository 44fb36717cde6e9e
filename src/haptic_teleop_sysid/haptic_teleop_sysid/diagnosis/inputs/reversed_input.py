"""Recordings whose input seems to have the opposite sign: it takes energy out of the joint."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from haptic_teleop_sysid.logs.evidence import brakes, speed_of
from haptic_teleop_sysid.recordings.dataset import DataSet


@dataclass(frozen=True)
class ReversedInput:
    """``what`` seems to be wrong, and the ``remedy``, in words."""

    what: str
    remedy: str

    @property
    def sentence(self) -> str:
        """Both."""
        return f"{self.what}; {self.remedy}"


def reversed_input(data: Sequence[DataSet]) -> ReversedInput | None:
    """What to say where the input brakes the joint on the whole in all of the recordings; else None.

    What drives a joint against friction gives it energy. A joint that a hand or another axis moves is braked
    by its motor, too, so that this is no proof.
    """
    if not data or not all(_brakes(d) for d in data):
        return None
    log = next((name for d in data if (name := _log_of(d))), None)
    what = "the input seems to have the opposite sign: it brakes the joint on the whole, in every recording"
    if log is None:
        return ReversedInput(what, "reverse it where it is recorded, unless a hand moved the joint")
    suggest = f"haptic-teleop import {log} --suggest > mapping.yaml"
    return ReversedInput(what, f"`{suggest}` corrects it; then give --mapping mapping.yaml")


def _brakes(d: DataSet) -> bool:
    speed = speed_of(d.motor_position, d.motor_velocity, False)
    if speed is None or len(speed) != len(d.input):
        return False
    good = d.valid if len(d.valid) else np.ones(len(d), dtype=np.bool_)
    return brakes(d.input[good], speed[good])


def _log_of(d: DataSet) -> str | None:
    """The log that a data set was read from, or what its recording was imported from; None where it was
    recorded as it is."""
    story = d.experiment.get("import")
    if not isinstance(story, dict) or "file" not in story:
        return None
    return d.name if story["file"] == Path(d.name).name else str(story["file"])
