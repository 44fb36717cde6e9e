"""A recording on disk: which files hold it, how it describes itself, and its messages in batches."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping
from io import BytesIO
from pathlib import Path, PurePath
from typing import Any, BinaryIO

import yaml
import zstandard

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_control.recording import sqlite_messages
from haptic_teleop_control.recording.batches import Batch, decompress_messages, mcap_batches
from haptic_teleop_control.recording.mcap_records import MAGIC, Damaged
from haptic_teleop_control.recording.mcap_scan import McapScan

METADATA = "metadata.yaml"
SELF_DESCRIPTION = "haptic_teleop"
KEYS = ("parameters", "parameters_at_stop", "experiment")
SUFFIXES = {"mcap": (".mcap", ".mcap.zstd"), "sqlite3": (".db3", ".db3.zstd")}


class Bag:
    """The files of one recording, and what became known of it while reading.

    ``types`` (message type by topic), ``custom`` (self-description, texts), ``problems``, ``lost`` and
    ``whole`` fill while ``batches`` is consumed.
    """

    def __init__(self, path: Path, files: list[Path], storage: str, information: Mapping[str, Any]) -> None:
        self.path, self.files, self.storage = path, files, storage
        self.information = information
        self.types: dict[str, str] = {}
        self.custom: dict[str, str] = {}
        self.problems: list[str] = []
        self.lost: list[tuple[int, int]] = []
        self.whole = True
        self.lossy = False
        self.per_message = str(information.get("compression_mode") or "").lower() == "message"

    def damage(self, sentence: str, lossy: bool = True) -> None:
        """Notes that something is broken, and with ``lossy`` that messages may be missing."""
        self.whole = False
        self.lossy |= lossy
        self.problems.append(sentence)

    def batches(self, select: Callable[[str, str], bool]) -> Iterator[Batch]:
        """All messages, file by file; those of topics (name, type) not selected are only counted."""
        for file in self.files:
            try:
                found = self._mcap(file, select) if self.storage == "mcap" else self._sqlite(file, select)
                for batch in found:
                    yield decompress_messages(batch) if self.per_message else batch
            except Damaged as damage:
                self.damage(f"{file}: {damage}")
            except OSError as error:
                self.damage(f"{file}: it cannot be read ({error.strerror or error})")

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

    def _mcap(self, file: Path, select: Callable[[str, str], bool]) -> Iterator[Batch]:
        with open_storage(file) as stream:
            scan = McapScan(stream)
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

    def _sqlite(self, file: Path, select: Callable[[str, str], bool]) -> Iterator[Batch]:
        with sqlite_messages.opened(file) as connection:
            for batch, kind in sqlite_messages.batches(connection, select):
                self.types[batch.topic] = kind
                yield batch


def describe(bag: Bag) -> dict[str, dict[str, Any]]:
    """``parameters``, ``parameters_at_stop`` and ``experiment`` as the recording describes itself, {} where
    unknown."""
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
            result[key] = value
        except (TypeError, ValueError):
            bag.problems.append(
                f"{bag.path / METADATA}: {SELF_DESCRIPTION}.{key} is no JSON object and is passed over"
            )
    return result


def open_bag(path: Path) -> Bag:
    """The recording at ``path``, a directory or a storage file; RecordingError when there is none."""
    try:
        if path.name == METADATA and path.is_file():
            path = path.parent
        if path.is_dir():
            return _open_directory(path)
        if path.is_file():
            return Bag(path, [path], _storage_of(path), {})
    except PermissionError:
        raise RecordingError(f"{path}: it may not be read: ask for permission to read it") from None
    raise RecordingError(
        f"{path}: there is no such file or directory: name a recording (a rosbag2 directory)"
    )


def _open_directory(path: Path) -> Bag:
    information, problem = _read_metadata(path)
    storage = str(information.get("storage_identifier") or "")
    if storage and storage not in SUFFIXES:
        raise RecordingError(
            f"{path}: storage {storage!r} is not known: convert it with `ros2 bag convert` to mcap"
        )
    names = information.get("relative_file_paths")
    if isinstance(names, list) and names:
        listed = [path / PurePath(str(name)).name for name in names]
        files = [file for file in listed if file.is_file()]
        missing = [
            f"{file}: it is listed in {METADATA} but is not there" for file in listed if file not in files
        ]
    else:
        files, missing = [], []
    if not files:
        files = sorted((f for f in path.iterdir() if f.is_file() and _kind(f.name)), key=_by_number)
    if not files:
        raise RecordingError(_nothing_in(path, missing))
    kinds = {_kind(file.name) for file in files}
    bag = Bag(path, files, storage or (_kind(files[0].name) or "mcap"), information)
    if len(kinds) > 1 and not storage:
        bag.files = [file for file in files if _kind(file.name) == bag.storage]
    if problem:
        bag.damage(problem, lossy=False)
    for sentence in missing:
        bag.damage(sentence)
    return bag


def _read_metadata(path: Path) -> tuple[dict[str, Any], str | None]:
    file = path / METADATA
    try:
        information = yaml.safe_load(file.read_text())["rosbag2_bagfile_information"]
        if isinstance(information, dict):
            return information, None
    except FileNotFoundError:
        return (
            {},
            f"{file}: it is missing, as when the recorder was killed; `haptic-teleop recover` writes it anew",
        )
    except (yaml.YAMLError, UnicodeDecodeError, KeyError, TypeError):
        pass
    return {}, f"{file}: it is damaged; `haptic-teleop recover` writes it anew"


def _custom_in(text: str) -> dict[str, str]:
    """The custom data in the copy of metadata.yaml that rosbag2 puts into the MCAP file."""
    try:
        custom = yaml.safe_load(text)["custom_data"]
    except (yaml.YAMLError, KeyError, TypeError):
        return {}
    return custom if isinstance(custom, dict) else {}


def _nothing_in(path: Path, missing: list[str]) -> str:
    inner = sorted(p.name for p in path.iterdir() if p.is_dir() and any(_kind(f.name) for f in p.iterdir()))
    if inner:
        shown = ", ".join(inner[:5]) + (", ..." if len(inner) > 5 else "")
        return f"{path}: it is a folder of recordings: name one of them ({shown})"
    if missing:
        return f"{path}: {METADATA} is there but its data is not: copy the .mcap files beside it"
    return f"{path}: it holds no recording (no .mcap or .db3 file): name a rosbag2 directory"


def _storage_of(file: Path) -> str:
    if kind := _kind(file.name):
        return kind
    with file.open("rb") as stream:
        head = stream.read(16)
    if head.startswith(MAGIC):
        return "mcap"
    if head.startswith(sqlite_messages.MAGIC):
        return "sqlite3"
    raise RecordingError(f"{file}: it is no recording: name a rosbag2 directory, or an .mcap or .db3 file")


def _kind(name: str) -> str | None:
    return next((kind for kind, suffixes in SUFFIXES.items() if name.endswith(suffixes)), None)


def _by_number(file: Path) -> list[Any]:
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", file.name)]


def open_storage(file: Path) -> BinaryIO:
    """An MCAP file opened for reading, decompressed if it is compressed as a whole."""
    if not file.name.endswith(".zstd"):
        return file.open("rb")
    try:
        with file.open("rb") as packed:
            return BytesIO(zstandard.ZstdDecompressor().stream_reader(packed).read())
    except zstandard.ZstdError:
        raise Damaged("it cannot be decompressed") from None
