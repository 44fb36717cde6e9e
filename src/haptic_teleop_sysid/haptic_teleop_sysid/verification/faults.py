"""The faults in a recording: what the nodes reported, the states that they entered, what the recorder could
not do.

A fault is told even if it was reset later: what the robots did after it is not what was asked for.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from haptic_teleop_control.recording import Recording
from haptic_teleop_control.recording.said import STATE, Status
from haptic_teleop_control.teleoperation.faults import FAULTS
from haptic_teleop_control.teleoperation.machine import State

ERROR, STALE = 2, 3
COUNT = "fault "
"""Beginning of the names under which a node's diagnostics count its faults."""
REPORTED_WITHIN = 2.5
"""s after a node entered its fault that its diagnostics, at 1 Hz, tell of it."""
UNTOLD = "the recording does not say which"


@dataclass(frozen=True)
class Fault:
    """node: its name, or what else reports. sentence: what it says. start, end: s of the run's time; end is
    None where it lasted to the end of the recording; both are None where it is only counted."""

    node: str
    sentence: str
    start: float | None = None
    end: float | None = None

    def in_words(self) -> str:
        """One sentence for people."""
        text = f"{self.node}: {self.sentence.rstrip('.')}"
        if self.start is None:
            return f"{text}."
        until = "to the end of the recording" if self.end is None else f"to {self.end:.2f} s"
        return f"{text} (in fault from {self.start:.2f} s {until})."

    def as_json(self) -> dict[str, Any]:
        """As plain data."""
        return asdict(self)


def find_faults(recording: Recording, origin: int, end: int) -> list[Fault]:
    """Return the faults in order of time, those that are only counted behind the others. origin: ns, the
    run's time zero. end: ns; what is said later is said by nodes that stop."""
    by_node: dict[str, list[Status]] = {}
    for status in recording.diagnostics:
        by_node.setdefault(status.node, []).append(status)
    timed = _entered(recording.states, origin, _counted(recording.experiment))
    counted: list[Fault] = []
    for node, statuses in by_node.items():
        own = [fault for fault in timed if fault.node == node]
        others = [fault for fault in timed if fault.node != node]
        reported = _reported(node, statuses, origin)
        timed = [*others, *_joined(own, reported)]
        if not own and not reported:
            counted += _increased(node, statuses)
    problems = recording.reception.get("problems", [])
    counted += [Fault("recorder", str(one)) for one in problems] if isinstance(problems, list) else []
    if not timed:
        counted += [Fault("lockstep", one) for one in _counted(recording.experiment)]
    last = _seconds(end, origin)
    ended = [replace(one, end=None) if one.end is not None and one.end >= last else one for one in timed]
    return [*sorted(ended, key=lambda one: one.start or 0.0), *counted]


def _seconds(stamp: int, origin: int) -> float:
    return (stamp - origin) * 1e-9


def _entered(
    states: Mapping[str, Sequence[tuple[int, str]]], origin: int, counted: Sequence[str]
) -> list[Fault]:
    """By the topics on which a node says which state it enters."""
    found = []
    for topic, texts in states.items():
        for number, (received, text) in enumerate(texts):
            if text != State.FAULT.value or (number and texts[number - 1][1] == text):
                continue
            left = next((at for at, later in texts[number + 1 :] if later != text), None)
            end = None if left is None else _seconds(left, origin)
            sentence = "; ".join(counted) or f"it entered its state fault; {UNTOLD}"
            found.append(Fault(topic.removesuffix(STATE), sentence, _seconds(received, origin), end))
    return found


def _reported(node: str, statuses: Sequence[Status], origin: int) -> list[Fault]:
    """By its diagnostics: each stretch of errors of one sentence."""
    found: list[Fault] = []
    open_ = False
    for status in statuses:
        at = _seconds(status.received, origin)
        if status.level not in (ERROR, STALE):
            if open_:
                found[-1] = replace(found[-1], end=at)
            open_ = False
            continue
        sentence = status.message or "it reports an error without a message"
        if open_ and found[-1].sentence == sentence:
            continue
        if open_:
            found[-1] = replace(found[-1], end=at)
        found.append(Fault(node, sentence, at, None))
        open_ = True
    return found


def _joined(entered: Sequence[Fault], reported: Sequence[Fault]) -> list[Fault]:
    """The time of the state, which is exact, with the sentence of the diagnostics."""
    left, result = list(reported), []
    for fault in entered:
        start, end = fault.start or 0.0, np.inf if fault.end is None else fault.end
        told = [one for one in left if start - 0.1 <= (one.start or 0.0) <= end + REPORTED_WITHIN]
        left = [one for one in left if one not in told]
        result.append(replace(fault, sentence=told[0].sentence) if told else fault)
    return result + left


def _increased(node: str, statuses: Sequence[Status]) -> list[Fault]:
    """Faults that were counted between two reports and reset before the next one told of them."""
    found = []
    for name in (key for key in statuses[-1].values if key.startswith(COUNT)):
        counts = [count for status in statuses if (count := _whole(status.values.get(name))) is not None]
        more = counts[-1] - counts[0] if counts else 0
        if more > 0:
            found.append(Fault(node, f"{_described(name.removeprefix(COUNT))}, counted {_times(more)}"))
    return found


def _counted(experiment: Mapping[str, Any]) -> list[str]:
    """What a run without nodes counted."""
    stated = experiment.get("faults")
    pairs: Iterable[tuple[str, Any]] = stated.items() if isinstance(stated, Mapping) else ()
    return [
        f"{_described(str(name))}, counted {_times(count)}" for name, count in pairs if isinstance(count, int)
    ]


def _described(name: str) -> str:
    return f"{name}: {FAULTS[name]}" if name in FAULTS else name


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def _whole(text: str | None) -> int | None:
    return int(text) if text is not None and text.strip().isdecimal() else None
