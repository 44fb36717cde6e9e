"""Recordings with holes and recordings that are too long: what can be used, what is said, what is refused."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_control.recording.bag_files import find_files
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.records import records_from
from haptic_teleop_sysid.recordings.channels import STATES
from haptic_teleop_sysid.recordings.dataset import DataSet

#: Samples in a row of the shortest piece that counts: below, nothing can be said about six parameters and
#: their noise. A log of 12 s at 30 Hz has 360.
SHORTEST_STRETCH = 250
#: Samples of all recordings together that a diagnosis keeps in memory, so that it stays below 2 GiB.
MOST_SAMPLES = 800_000
#: What is said begins so of a recording of which most is not used.
ONLY = "only "


def with_cuts_told(dataset: DataSet) -> DataSet:
    """The data set whose problems also say where it is cut apart, and which pieces are used."""
    pieces = records_from(dataset, commanded=True)
    used = [p for p in pieces if len(p) >= SHORTEST_STRETCH]
    whole = len(pieces) == 1 and len(pieces[0]) > 0.999 * len(dataset)
    if whole or not used:
        return dataset
    times = ", ".join(f"{p.start:.3f} to {p.start + len(p) * p.dt:.3f} s" for p in used[:6])
    more = f" and {len(used) - 6} more" if len(used) > 6 else ""
    left = dataset.dt * (len(dataset) - sum(len(p) for p in used))
    whole_s = dataset.dt * len(dataset)
    little = f"{ONLY}{whole_s - left:.3g} of its {whole_s:.3g} s are used: " if left > 0.5 * whole_s else ""
    problem = (
        f"{little}it is cut apart at its holes and used from {times}{more}; {left:.3f} s are left out "
        f"(holes, and pieces of fewer than {SHORTEST_STRETCH} samples)"
    )
    return replace(dataset, problems=(*dataset.problems, problem))


def refuse_too_long(bags: Sequence[str], model: Model) -> None:
    """Raise RecordingError for recordings that announce more samples than MOST_SAMPLES; nothing is read."""
    topic = STATES.get(model.robot) or str((model.io or {}).get("motor", {}).get("topic", ""))
    announced = {bag: _announced(bag, topic) for bag in bags}
    if sum(announced.values()) <= MOST_SAMPLES:
        return
    bag, most = max(announced.items(), key=lambda one: one[1])
    raise RecordingError(
        f"the recordings hold {sum(announced.values())} samples of {topic} ({bag} {most}), and a diagnosis "
        f"keeps at most {MOST_SAMPLES} in memory: a few minutes say as much, so give shorter ones (cut them "
        "with `ros2 bag convert`, which takes a start and an end), or record at a lower rate."
    )


def _announced(bag: str, topic: str) -> int:
    """Messages of a topic that a bag's metadata.yaml announces; 0 where it announces none."""
    information = find_files(Path(bag)).information
    counts = information.get("topics_with_message_count") or []
    try:
        return sum(int(t["message_count"]) for t in counts if t["topic_metadata"]["name"] == topic)
    except (KeyError, TypeError, ValueError):
        return 0
