"""A recording on disk: its messages in batches, how it describes itself, and what is wrong with it."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from haptic_teleop_control.recording import sqlite_messages
from haptic_teleop_control.recording.bag_files import METADATA, BagFiles, find_files, open_storage
from haptic_teleop_control.recording.batches import Batch, decompress_messages, mcap_batches
from haptic_teleop_control.recording.expansion import Budget, Damaged
from haptic_teleop_control.recording.mcap_scan import McapScan

SELF_DESCRIPTION = "haptic_teleop"
KEYS = ("parameters", "parameters_at_stop", "models", "experiment", "reception")


class Bag:
    """The files of one recording, and what became known of it while reading.

    ``types`` (message type by topic), ``custom`` (self-description, texts), ``problems``, ``lost`` and
    ``whole`` fill while ``batches`` is consumed.
    """

    def __init__(self, found: BagFiles) -> None:
        self.path, self.files, self.storage = found.path, found.files, found.storage
        self.information = found.information
        self.types: dict[str, str] = {}
        self.custom: dict[str, str] = {}
        self.problems: list[str] = []
        self.lost: list[tuple[int, int]] = []
        self.whole = True
        self.lossy = False
        self._definitions: Callable[[str], tuple[str, str]] = lambda _: ("", "")
        self.per_message = str(self.information.get("compression_mode") or "").lower() == "message"
        if found.problem:
            self.damage(found.problem, lossy=False)
        for sentence in found.missing:
            self.damage(sentence)

    def damage(self, sentence: str, lossy: bool = True) -> None:
        """Notes that something is broken, and with ``lossy`` that messages may be missing."""
        self.whole = False
        self.lossy |= lossy
        self.problems.append(sentence)

    def definition(self, kind: str) -> tuple[str, str]:
        """How the file that is being read defines a message type: ("ros2msg", "ros2idl" or alike, the text);
        both empty where it does not. Also for `select` of `batches`."""
        return self._definitions(kind)

    def batches(self, select: Callable[[str, str], bool]) -> Iterator[Batch]:
        """All messages, file by file; those of topics (name, type) not selected are only counted."""
        for file in self.files:
            try:
                budget = Budget(file.stat().st_size)
                messages = self._mcap if self.storage == "mcap" else self._sqlite
                for batch in messages(file, select, budget):
                    yield decompress_messages(batch, budget) if self.per_message else batch
            except Damaged as damage:
                self.damage(f"{file}: {damage}")
            except OSError as error:
                self.damage(f"{file}: it cannot be read ({error.strerror or error})")

    def announced(self) -> dict[str, int]:
        """Messages by topic that metadata.yaml announces; {} when it is missing or damaged."""
        try:
            topics = self.information.get("topics_with_message_count") or []
            return {t["topic_metadata"]["name"]: int(t["message_count"]) for t in topics}
        except (KeyError, TypeError, ValueError, AttributeError):
            return {}

    def check_counts(self, counts: Mapping[str, int]) -> None:
        """Compares the messages found with those that metadata.yaml announces."""
        try:
            topics = self.information.get("topics_with_message_count") or []
            announced = {t["topic_metadata"]["name"]: int(t["message_count"]) for t in topics}
            for topic in topics:
                self.types.setdefault(topic["topic_metadata"]["name"], str(topic["topic_metadata"]["type"]))
        except (KeyError, TypeError, ValueError, AttributeError):
            self.damage(f"{self.path / METADATA}: its list of topics is damaged", lossy=False)
            return
        for name, number in announced.items():
            if counts.get(name, 0) != number:
                self.damage(f"{self.path}: {counts.get(name, 0)} of {number} messages are there on {name}")

    def _mcap(self, file: Path, select: Callable[[str, str], bool], budget: Budget) -> Iterator[Batch]:
        with open_storage(file, budget) as stream:
            scan = McapScan(stream, budget)
            self._definitions = scan.definition_of
            yield from mcap_batches(scan, select)
        self.take_from(file, scan)

    def take_from(self, file: Path, scan: McapScan) -> None:
        """Takes over what a scan of one file found beside messages, after the scan is through."""
        for number, channel in scan.channels.items():
            self.types.setdefault(channel.topic, scan.type_of(number) or "unknown")
        for record in scan.metadata:
            if record.name == SELF_DESCRIPTION:
                self.custom.update(record.metadata)
            elif record.name == "rosbag2" and not self.information:
                self.custom = {**_custom_in(record.metadata.get("serialized_metadata", "")), **self.custom}
        self.lost += scan.lost
        for problem in scan.problems:
            self.damage(f"{file}: {problem}")

    def _sqlite(self, file: Path, select: Callable[[str, str], bool], budget: Budget) -> Iterator[Batch]:
        if missing := sqlite_messages.missing_bytes(file):
            self.damage(f"{file}: it is cut: {missing} bytes are missing at its end")
        with sqlite_messages.opened(file, budget) as connection:
            self._definitions = sqlite_messages.definitions(connection).__getitem__
            for batch, kind in sqlite_messages.batches(connection, select, budget):
                self.types[batch.topic] = kind
                yield batch


def describe(bag: Bag) -> dict[str, dict[str, Any]]:
    """What the recording says of itself under each of KEYS, {} where unknown."""
    custom = bag.information.get("custom_data")
    texts = {**bag.custom, **(custom if isinstance(custom, dict) else {})}
    result: dict[str, dict[str, Any]] = {key: {} for key in KEYS}
    for key in KEYS:
        text = texts.get(f"{SELF_DESCRIPTION}.{key}")
        if text is None:
            continue
        try:
            value = json.loads(text)
            if not isinstance(value, dict):
                raise ValueError
            result[key] = _numbers(value) if key.startswith("parameters") else value
        except (TypeError, ValueError):
            bag.problems.append(
                f"{bag.path / METADATA}: {SELF_DESCRIPTION}.{key} is no JSON object and is passed over"
            )
    return result


def open_bag(path: Path) -> Bag:
    """The recording at ``path``, a directory or a storage file; RecordingError when there is none."""
    return Bag(find_files(path))


def _custom_in(text: str) -> dict[str, str]:
    """The custom data in the copy of metadata.yaml that rosbag2 puts into the MCAP file."""
    try:
        custom = yaml.safe_load(text)["custom_data"]
    except (yaml.YAMLError, KeyError, TypeError):
        return {}
    return custom if isinstance(custom, dict) else {}


#: Numbers that JSON does not have, as the writer states them.
_NO_JSON = {".inf": math.inf, "-.inf": -math.inf, ".nan": math.nan}


def _numbers(part: Any) -> Any:
    """Plain data in which these are numbers again."""
    if isinstance(part, dict):
        return {key: _numbers(one) for key, one in part.items()}
    if isinstance(part, list):
        return [_numbers(one) for one in part]
    return _NO_JSON.get(part, part) if isinstance(part, str) else part
