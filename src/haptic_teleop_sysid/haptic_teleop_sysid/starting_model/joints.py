"""The joints of a recording that a model can be made of."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_control.recording import Recording
from haptic_teleop_sysid.logs.convert import ARM


def joints_in(recording: Recording, name: str) -> dict[str, dict[str, Any]]:
    """Return the io section of each joint that a recording can give a model of: those that an import states,
    else every joint with positions and efforts; a joint `j_arm` is the arm of `j` or of `j_motor`.

    Raises RecordingError when there is none.
    """
    story = recording.experiment.get("import")
    if isinstance(story, Mapping) and isinstance(story.get("io"), Mapping):
        stated = {j: dict(io) for j, io in story["io"].items() if io.get("input")}
        if not stated:
            raise RecordingError(
                f"{name} has no input beside its positions, and a model needs both: name the column of the "
                "torque, current, voltage or command in the mapping."
            )
        return stated
    found: dict[str, dict[str, Any]] = {}
    for topic, series in recording.topics.items():
        if series.position is None or series.effort is None:
            continue
        for joint in series.names:
            stem = joint.removesuffix("_motor")
            if joint.endswith(ARM) and joint.removesuffix(ARM) in {
                n.removesuffix("_motor") for n in series.names
            }:
                continue
            if not np.any(np.isfinite(series.signal(joint, "effort"))):
                continue
            arm = {"topic": topic, "joint": stem + ARM} if stem + ARM in series.names else None
            found[stem] = {
                "input": {"topic": topic, "joint": joint, "field": "effort"},
                "motor": {"topic": topic, "joint": joint},
                "arm": arm,
            }
    if not found:
        raise RecordingError(f"{name} has no joint with positions and efforts: record or import both.")
    return found
