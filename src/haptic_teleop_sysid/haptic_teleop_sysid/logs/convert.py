"""A log and a mapping become a recording of joint states, which tells what was changed on the way."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.errors import ConfigurationError, MismatchError, RecordingError
from haptic_teleop_control.recording import JointStateSeries, Recording
from haptic_teleop_sysid.logs.clock import BACK, stamps_of
from haptic_teleop_sysid.logs.contradictions import contradictions
from haptic_teleop_sysid.logs.log import Log
from haptic_teleop_sysid.logs.mapping import Mapping
from haptic_teleop_sysid.logs.signals import Signal, signals_of

Array = NDArray[np.float64]
STATES = "/plant/joint_states"
ARM = "_arm"
"""Behind a joint's name: the joint's arm, in the recorded joint states."""


@dataclass(frozen=True)
class _Rows:
    """Signals by joint on common rows: ``stamps`` (n,) ns."""

    stamps: NDArray[np.int64]
    joints: dict[str, dict[str, Array]]


def convert(log: Log, mapping: Mapping) -> Recording:
    """Return the recording that a mapping makes of a log: joint states on STATES (joint `j` and, where it has
    an arm, `j_arm`; of rows of another time on topics of their own), in SI units, with the input as effort.

    ``experiment`` holds the whole story under "import": file, digest, mapping, units, changes, oddities.
    Raises what `signals_of` and `stamps_of` raise, and MismatchError where signals contradict their units.
    """
    columns: list[str] = []
    changes: list[str] = []
    odd: list[str] = []
    units: dict[str, dict[str, str]] = {}
    io: dict[str, Any] = {}
    by_rows: dict[str, _Rows] = {}
    taken: dict[int, str] = {}
    for joint, entries in mapping.joints.items():
        signals = signals_of(log, joint, entries, mapping.source)
        columns += [s.told for s in signals.values()]
        odd += [s.column.told for s in signals.values() if s.column.told]
        odd += _shared(signals, taken)
        _one_joint(log, mapping, joint, signals, by_rows, columns, changes, odd, io)
        linear = next(s for n, s in signals.items() if n != "input").quantity in ("length", "velocity")
        units[joint] = {"position": "m" if linear else "rad", "velocity": "m/s" if linear else "rad/s"}
        if "input" in signals:
            units[joint]["input"] = signals["input"].unit
    topics = {topic: _series(rows) for topic, rows in by_rows.items()}
    story = {
        "file": log.path.name,
        "sha256": digest(log.path),
        "kind": log.kind,
        "mapping": mapping.plain(),
        "units": units,
        "io": io,
        "read": list(log.remarks),
        "by": Path(mapping.source).name,
        "columns": columns,
        "changes": [*mapping.notes, *dict.fromkeys((*columns, *changes))],
        "odd": list(dict.fromkeys(odd)),
    }
    experiment = {"kind": "imported", "note": f"imported from {log.path.name}", "import": story}
    return Recording(
        log.path,
        topics,
        experiment=experiment,
        problems=list(story["odd"]),
        counts={n: len(s) for n, s in topics.items()},
        complete=log.whole,
        types=dict.fromkeys(topics, "sensor_msgs/msg/JointState"),
    )


def _one_joint(
    log: Log,
    mapping: Mapping,
    joint: str,
    signals: dict[str, Signal],
    by_rows: dict[str, _Rows],
    columns: list[str],
    changes: list[str],
    odd: list[str],
    io: dict[str, Any],
) -> None:
    base = signals.get("motor_position") or signals["motor_velocity"]
    told: list[str] = []
    stamps, rows, _ = stamps_of(log, mapping, base.column, told)
    _sorted_told(told, columns, odd)
    time = (stamps - stamps[0]) * 1e-9
    values: dict[str, Array] = {}
    aligned: dict[str, Signal] = {}
    elsewhere: dict[str, tuple[NDArray[np.int64], Array]] = {}
    for name, signal in signals.items():
        if signal.column.group == base.column.group and len(signal.column.values) == len(base.column.values):
            values[name] = signal.values[rows]
            aligned[name] = Signal(**{**signal.__dict__, "values": values[name]})
            continue
        own_stamps, own_rows, where = stamps_of(log, mapping, signal.column, [])
        elsewhere[name] = own_stamps, signal.values[own_rows]
        if name != "input":
            values[name] = np.interp(stamps, own_stamps, signal.values[own_rows])
            changes.append(
                f"{signal.name} has times of its own ({where}) and was interpolated to the motor's"
            )
    refuted, doubtful = contradictions(time, aligned)
    if refuted:
        back = next((f" But {one.partition(':')[0]}." for one in told if one.startswith(BACK)), "")
        raise MismatchError(
            f"{log.path}: {refuted[0]}{back} Correct the unit or sign in "
            f"{'the header or ' if mapping.source == 'header' else ''}a mapping, or give a gain."
        )
    odd += doubtful
    for name, signal in aligned.items():
        missing = int(np.sum(~np.isfinite(values[name])))
        if missing:
            odd.append(f"{signal.name} has no number in {missing} of {len(stamps)} rows")
    for part in ("motor", "arm"):
        if f"{part}_velocity" in values and f"{part}_position" not in values:
            values[f"{part}_position"] = _integrated(time, values[f"{part}_velocity"])
            changes.append(
                f"{joint}.{part}_position is the integral of {joint}.{part}_velocity (trapezoids), from "
                "zero: only the velocity was logged, and its offset drifts in it"
            )
    topic = STATES if STATES not in by_rows or np.array_equal(by_rows[STATES].stamps, stamps) else ""
    topic = topic or f"/plant/{_word(joint)}/joint_states"
    for name in (joint, joint + ARM):
        if any(name in rows.joints for rows in by_rows.values()):
            raise ConfigurationError(
                f"{mapping.source}: two joints would both be recorded as {name}: rename one."
            )
    by_rows.setdefault(topic, _Rows(stamps, {}))
    states = {n.removeprefix("motor_"): v for n, v in values.items() if not n.startswith("arm_")}
    states = {("effort" if n == "input" else n): v for n, v in states.items()}
    by_rows[topic].joints[joint] = states
    arm = {n.removeprefix("arm_"): v for n, v in values.items() if n.startswith("arm_")}
    if arm:
        by_rows[topic].joints[joint + ARM] = arm
    drive = {"topic": topic, "joint": joint, "field": "effort"}
    if "input" in elsewhere:
        drive["topic"] = f"/plant/{_word(joint)}/input"
        own_stamps, own_values = elsewhere["input"]
        by_rows[drive["topic"]] = _Rows(own_stamps, {joint: {"effort": own_values}})
        changes.append(f"{joint}.input has times of its own and is recorded on {drive['topic']}")
    io[joint] = {
        "input": drive if "input" in signals else None,
        "motor": {"topic": topic, "joint": joint},
        "arm": {"topic": topic, "joint": joint + ARM} if arm else None,
    }


def _shared(signals: dict[str, Signal], taken: dict[int, str]) -> list[str]:
    """Columns that another joint has, too, in sentences; ``taken``: columns -> signals, added to."""
    told = []
    for signal in signals.values():
        other = taken.setdefault(id(signal.column), signal.name)
        if other != signal.name:
            told.append(f"{signal.name} and {other} are both column {signal.column.name!r}: is that meant?")
    return told


def _sorted_told(told: list[str], columns: list[str], odd: list[str]) -> None:
    """What a clock tells: what it was read from, and what is odd."""
    done = ("time: column", "no time is read")
    columns += [t for t in told if t.startswith(done)]
    odd += [t for t in told if not t.startswith(done)]


def _integrated(time: Array, velocity: Array) -> Array:
    """The integral (n,) of a velocity (n,) over times (n,); not finite where the velocity is not."""
    good = np.isfinite(velocity)
    v = np.interp(time, time[good], velocity[good])
    steps = np.maximum(np.diff(time), 0.0)
    way = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * steps)])
    return np.where(good, way, np.nan)


def _series(rows: _Rows) -> JointStateSeries:
    names = tuple(rows.joints)
    n = len(rows.stamps)
    table: dict[str, Array | None] = {}
    for field in ("position", "velocity", "effort"):
        found = [rows.joints[name].get(field) for name in names]
        table[field] = (
            None
            if all(v is None for v in found)
            else np.column_stack([np.full(n, np.nan) if v is None else v for v in found])
        )
    # Messages are received in the order of the rows, whatever their stamps say.
    received = np.maximum.accumulate(rows.stamps)
    return JointStateSeries(
        rows.stamps, received, names, table["position"], table["velocity"], table["effort"]
    )


def _word(joint: str) -> str:
    """A joint's name as part of a topic's name."""
    word = "".join(c if c.isalnum() and c.isascii() else "_" for c in joint).strip("_")
    return word if word[:1].isalpha() else f"j{word}"


def digest(path: Path) -> str:
    """SHA-256 of a file, or of a folder's files in the order of their names."""
    found = hashlib.sha256()
    files = sorted(p for p in path.iterdir() if p.is_file()) if path.is_dir() else [path]
    try:
        for file in files:
            with file.open("rb") as stream:
                while block := stream.read(1 << 20):
                    found.update(block)
    except OSError as error:
        raise RecordingError(f"{path} cannot be read ({error}): name another log.") from error
    return found.hexdigest()
