"""Reads a recording: a rosbag2 directory (MCAP or SQLite3, in one or several files), or one such file."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_control.recording.bag_folder import Bag, describe, open_bag
from haptic_teleop_control.recording.joint_state_cdr import decode_groups
from haptic_teleop_control.recording.said import Status, diagnostics_in, is_said, states_in
from haptic_teleop_control.recording.series import JointStateSeries
from haptic_teleop_control.recording.texts import STRING_TYPE

JOINT_STATE = ("sensor_msgs/msg/JointState", "sensor_msgs/JointState")


@dataclass
class Recording:
    """What a recording holds.

    topics      name -> JointStateSeries, for each topic of type sensor_msgs/JointState that has messages
    parameters  node name -> {parameter: value}, as the recording describes itself; {} when unknown
    parameters_at_stop   the same at the end of the recording where that differs, else {}
    models      path as a parameter states it -> text, of the model files that the parameters name
    experiment  {"kind": ..., "note": ...}, of a scenario also "planned_duration": s, 0 for until it is
                stopped; {} when unknown
    reception   {"lost_on_the_way": {topic: messages that were published but did not reach the recorder}}, by
                the publishers' own numbers, "ended": whether a scenario came to its end, and "problems":
                sentences of the recorder, if any; {} when it did not tell
    complete    True when no message is known to be missing and nothing is damaged
    problems    sentences that say what is missing, damaged or odd
    counts      messages by topic, of all types;  types   message type by topic
    lost        (start, end) ns of received time for which messages are known to be lost
    states      topic -> (received ns, text) for each std_msgs/String on a topic whose name ends with /state
    diagnostics what the nodes reported on topics of diagnostic_msgs/DiagnosticArray, in order of time
    """

    path: Path
    topics: dict[str, JointStateSeries]
    parameters: dict[str, Any] = field(default_factory=dict)
    parameters_at_stop: dict[str, Any] = field(default_factory=dict)
    models: dict[str, Any] = field(default_factory=dict)
    experiment: dict[str, Any] = field(default_factory=dict)
    reception: dict[str, Any] = field(default_factory=dict)
    complete: bool = True
    problems: list[str] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=dict)
    types: dict[str, str] = field(default_factory=dict)
    lost: list[tuple[int, int]] = field(default_factory=list)
    states: dict[str, list[tuple[int, str]]] = field(default_factory=dict)
    diagnostics: list[Status] = field(default_factory=list)

    def topic(self, name: str) -> JointStateSeries:
        """The series of one topic; RecordingError, naming those present, when there is none."""
        if name not in self.topics:
            raise RecordingError(_no_topic(self.path, name, self.topics))
        return self.topics[name]


def read_recording(path: str | Path, topics: Iterable[str] | None = None) -> Recording:
    """Reads ``path``; only ``topics`` when given (all must be there).

    Damage does not raise: what is whole is returned, with ``complete`` False and the damage told in
    ``problems``. ``states`` and ``diagnostics`` are read without ``topics`` only; messages of other types are
    counted, not decoded. Raises RecordingError, one sentence with
    file and remedy, when there is no recording, nothing of it is readable, it holds no joint states, or a
    topic is not in it.
    """
    bag = open_bag(Path(path))
    wanted = None if topics is None else set(topics)
    gathered: defaultdict[str, _Gatherer] = defaultdict(_Gatherer)
    said: defaultdict[str, list[tuple[int, bytes]]] = defaultdict(list)
    counts: Counter[str] = Counter()

    def select(name: str, kind: str) -> bool:
        if kind in JOINT_STATE:
            return wanted is None or name in wanted
        return wanted is None and is_said(name, kind)

    for batch in bag.batches(select):
        counts[batch.topic] += batch.count
        if batch.rows is not None and batch.kind not in JOINT_STATE:
            for which, matrix in batch.rows:
                said[batch.topic] += [
                    (int(batch.received[i]), row.tobytes()) for i, row in zip(which, matrix, strict=True)
                ]
        elif batch.rows is not None:
            gathered[batch.topic].add(batch.rows, batch.received)
    bag.check_counts(counts)
    if not counts:
        raise RecordingError(f"{path}: it holds no messages{_because(bag)}: name another recording")
    for name in sorted(wanted or ()):
        if name not in gathered:
            kind = bag.types.get(name)
            if counts[name]:
                raise RecordingError(
                    f"{path}: topic {name!r} holds {kind}: name a topic of sensor_msgs/JointState"
                )
            known = [topic for topic, kind in bag.types.items() if kind in JOINT_STATE and counts[topic]]
            raise RecordingError(_no_topic(path, name, known) + _because(bag))
    if not gathered:
        others = ", ".join(sorted(counts))
        raise RecordingError(
            f"{path}: it holds no joint states, only {others}: record a sensor_msgs/JointState topic"
        )
    series = {name: gathered[name].series() for name in sorted(gathered)}
    for name, one in series.items():
        bag.problems += [f"{path}: {name}: {problem}" for problem in one.problems]
        bag.whole &= len(one) == counts[name]
    description = describe(bag)
    states, diagnostics = _what_was_said(said, bag)
    return Recording(
        Path(path),
        series,
        **description,
        complete=bag.whole,
        problems=bag.problems,
        counts={name: counts[name] for name in sorted(bag.types)},
        types=dict(sorted(bag.types.items())),
        lost=bag.lost,
        states=states,
        diagnostics=diagnostics,
    )


def _what_was_said(
    said: Mapping[str, list[tuple[int, bytes]]], bag: Bag
) -> tuple[dict[str, list[tuple[int, str]]], list[Status]]:
    states: dict[str, list[tuple[int, str]]] = {}
    diagnostics: list[Status] = []
    for topic, messages in sorted(said.items()):
        if bag.types.get(topic, "").replace("/msg/", "/") == STRING_TYPE.replace("/msg/", "/"):
            states[topic], bad = states_in(messages)
        else:
            found, bad = diagnostics_in(messages)
            diagnostics += found
        if bad:
            sentence = f"{bag.path}: {topic}: {bad} of {len(messages)} messages cannot be decoded"
            bag.damage(sentence, lossy=False)
    return states, sorted(diagnostics, key=lambda one: one.received)


class _Gatherer:
    """Collects the messages of one topic by length, so that each length is decoded at once."""

    def __init__(self) -> None:
        self.received: list[NDArray[np.int64]] = []
        self.by_length: defaultdict[int, list[tuple[NDArray[np.intp], NDArray[np.uint8]]]] = defaultdict(list)
        self.count = 0

    def add(
        self, rows: list[tuple[NDArray[np.intp], NDArray[np.uint8]]], received: NDArray[np.int64]
    ) -> None:
        for which, matrix in rows:
            self.by_length[matrix.shape[1]].append((which + self.count, matrix))
        self.received.append(received)
        self.count += len(received)

    def series(self) -> JointStateSeries:
        received = np.concatenate(self.received)
        groups = [
            (np.concatenate([which for which, _ in parts]), np.concatenate([matrix for _, matrix in parts]))
            for parts in self.by_length.values()
        ]
        if np.any(np.diff(received) < 0):  # files and chunks need not be in the order of time
            rank = np.empty(len(received), np.intp)
            order = np.argsort(received, kind="stable")
            rank[order] = np.arange(len(received))
            received = received[order]
            groups = [_sorted(rank[which], matrix) for which, matrix in groups]
        return decode_groups(self.count, groups, received)


def _sorted(which: NDArray[np.intp], matrix: NDArray[np.uint8]) -> tuple[NDArray[np.intp], NDArray[np.uint8]]:
    order = np.argsort(which)
    return which[order], matrix[order]


def _no_topic(path: str | Path, name: str, present: Iterable[str]) -> str:
    known = ", ".join(sorted(present)) or "no topic"
    return f"{path}: no messages on topic {name!r}: it has joint states on {known}"


def _because(bag: Bag) -> str:
    return f" ({'; '.join(bag.problems)})" if bag.problems else ""
