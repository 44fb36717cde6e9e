"""What the coordinator announces and what participants report, as JSON on three topics.

    coordinator  -> all           Tick: these act at this stamp      Status: who is there, what is waited for
    participant  -> coordinator   Report: join, done, waiting, recorded, left

A repeated message is the same message: everything here may arrive twice. Names do not tell who speaks: two
runs of one file in one ROS domain have nodes of the same names. So reports bear their sender's id, and all of
one `scenario` the id of that run.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

TICK_TOPIC = "/simulated_time/tick"
STATUS_TOPIC = "/simulated_time/status"
REPORT_TOPIC = "/simulated_time/report"

PLANT, SOURCE, ANSWERER, LINK, RECORDER = "plant", "source", "answerer", "link", "recorder"
KINDS = (PLANT, SOURCE, ANSWERER, LINK, RECORDER)

WAITING, RUNNING, PAUSED, OVER, HALTED = "waiting", "running", "paused", "over", "halted"
WITHDRAWN = "withdrawn"
"""States of the coordinator. Withdrawn: before its time began it gave way to another one, to which its
participants turn."""
BEGUN, ENDED = (RUNNING, PAUSED), (OVER, HALTED, WITHDRAWN)
STATES = (WAITING, *BEGUN, *ENDED)

MOST_TEXT = 1 << 18
"""Characters; a status that names a hundred nodes has a tenth of that."""
LARGEST = 2**31 * 10**9
"""ns; what a stamp of ROS can hold."""
MOST_RATE = 1e6
"""Hz; beyond, and below its inverse, no stamps of samples can be told."""


class Delivery(NamedTuple):
    """A packet that the link hands over. way: its topic before the link. sent, arrival: ns."""

    way: str
    sent: int
    arrival: int


@dataclass(frozen=True)
class Member:
    """What a participant says of itself when it joins.

    name: the node's full name. rate: Hz, of a plant or source. topic: what a plant or source publishes.
    commands: where a plant is answered. topics: state topics that an answerer answers, in the order in which
    those of one stamp are answered; ways that a link takes; topics that a recorder keeps. linked: whether an
    answerer also sends into a link. silent: a plant whose first sample is not published.
    """

    name: str
    kind: str
    rate: float = 0.0
    topic: str = ""
    commands: str = ""
    topics: tuple[str, ...] = ()
    linked: bool = False
    silent: bool = False


@dataclass(frozen=True)
class Tick:
    """One grant. number: counts up by one from 1; a repeat bears the same number; 0 asks nothing but that it
    is answered, before time begins. stamp: ns of simulated time.
    due: names of the plants and sources that publish now. states: topics among theirs that somebody answers.
    newest: source's topic -> stamp that must have been taken before answering. deliveries: what the link
    hands over before the answer, in this order. session: the coordinator's id.
    """

    session: str
    number: int
    stamp: int
    due: tuple[str, ...]
    states: tuple[str, ...] = ()
    newest: Mapping[str, int] = field(default_factory=dict)
    deliveries: tuple[Delivery, ...] = ()


@dataclass(frozen=True)
class Status:
    """The coordinator's state, told when it changes and now and then. session: its id. members: names of
    those who have joined; senders: their ids, in the same order. reason: why time is halted, or what is
    waited for. refused: sender's id -> why it may not take part. achieved: simulated seconds per second so
    far. run: of the `scenario` that has started it, else empty. born: ns of the wall clock when the
    coordinator began."""

    session: str
    state: str
    stamp: int
    members: tuple[str, ...] = ()
    reason: str = ""
    refused: Mapping[str, str] = field(default_factory=dict)
    achieved: float = 0.0
    senders: tuple[str, ...] = ()
    run: str = ""
    born: int = 0


@dataclass(frozen=True)
class Report:
    """What a participant says. act: join, done (with tick `number`; with 0 `what` is the coordinator's
    session), waiting (for `what`), recorded, taken, left. stamps: recorded: topic -> newest stamp kept; done
    of a linked answerer: way -> newest stamp sent; taken: way -> stamp of the packet taken last, whose copies
    arrive at `arrivals` (ns). silent: done of a plant: its next sample is not published, because its device
    calibrates or is lost. sender: id of the participant. run: of the `scenario` that has started it, else
    empty.
    """

    name: str
    act: str
    number: int = 0
    what: str = ""
    stamps: Mapping[str, int] = field(default_factory=dict)
    arrivals: tuple[int, ...] = ()
    member: Member | None = None
    silent: bool = False
    sender: str = ""
    run: str = ""


def encode(message: Tick | Status | Report) -> str:
    """JSON text of a message."""
    content = {**vars(message), "type": type(message).__name__.lower()}
    if isinstance(message, Report) and message.member is not None:
        content["member"] = vars(message.member)
    return json.dumps(content, separators=(",", ":"))


def decode(text: str) -> Tick | Status | Report | None:
    """The message, or None for text that is none: a topic may carry anything, and whatever comes from here is
    taken for what the coordinator or a participant said."""
    if len(text) > MOST_TEXT:
        return None
    try:
        content = json.loads(text)
        kind = content.pop("type")
        if kind == "tick":
            return _tick(content)
        if kind == "status":
            return _status(content)
        if kind == "report":
            return _report(content)
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError):
        return None
    return None


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError
    value.encode()  # half a character would end whoever prints it
    return value


def _state(value: Any) -> str:
    if value not in STATES:
        raise ValueError
    return value


def _whole(value: Any) -> int:
    if type(value) is not int or not 0 <= value < LARGEST:
        raise ValueError
    return value


def _real(value: Any) -> float:
    if type(value) not in (int, float) or not math.isfinite(value):
        raise ValueError
    return float(value)


def _flag(value: Any) -> bool:
    if not isinstance(value, bool):
        raise TypeError
    return value


def _list(value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise TypeError
    return value


def _texts(value: Any) -> tuple[str, ...]:
    return tuple(_text(one) for one in _list(value))


def _stamps(value: Any) -> dict[str, int]:
    return {_text(topic): _whole(stamp) for topic, stamp in value.items()}


def _status(content: dict[str, Any]) -> Status:
    return Status(
        _text(content["session"]),
        _state(content["state"]),
        _whole(content["stamp"]),
        _texts(content["members"]),
        _text(content["reason"]),
        {_text(name): _text(why) for name, why in content["refused"].items()},
        _real(content["achieved"]),
        _texts(content["senders"]),
        _text(content["run"]),
        _whole(content["born"]),
    )


def _tick(content: dict[str, Any]) -> Tick:
    return Tick(
        _text(content["session"]),
        _whole(content["number"]),
        _whole(content["stamp"]),
        _texts(content["due"]),
        _texts(content["states"]),
        _stamps(content["newest"]),
        tuple(
            Delivery(_text(way), _whole(sent), _whole(arrival))
            for way, sent, arrival in _list(content["deliveries"])
        ),
    )


def _report(content: dict[str, Any]) -> Report:
    member = content["member"]
    return Report(
        _text(content["name"]),
        _text(content["act"]),
        _whole(content["number"]),
        _text(content["what"]),
        _stamps(content["stamps"]),
        tuple(_whole(arrival) for arrival in _list(content["arrivals"])),
        None if member is None else _member(member),
        _flag(content["silent"]),
        _text(content["sender"]),
        _text(content["run"]),
    )


def _member(content: dict[str, Any]) -> Member:
    rate, kind = _real(content["rate"]), _text(content["kind"])
    possible = 1 / MOST_RATE <= rate <= MOST_RATE if kind in (PLANT, SOURCE) else rate == 0.0
    if kind not in KINDS or not possible:
        raise ValueError
    return Member(
        _text(content["name"]),
        kind,
        rate,
        _text(content["topic"]),
        _text(content["commands"]),
        _texts(content["topics"]),
        _flag(content["linked"]),
        _flag(content["silent"]),
    )
