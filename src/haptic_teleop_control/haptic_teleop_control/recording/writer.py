"""Writes recordings: rosbag2 directories (version 9, MCAP) that describe themselves and outlive a killed
writer."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_control.recording.bag_files import METADATA
from haptic_teleop_control.recording.bag_folder import KEYS, SELF_DESCRIPTION
from haptic_teleop_control.recording.bag_metadata import TopicEntry, bag_information
from haptic_teleop_control.recording.definitions import JOINT_STATE_TYPE, message_definition
from haptic_teleop_control.recording.joint_state_cdr import encode
from haptic_teleop_control.recording.mcap_records import MESSAGE_HEAD
from haptic_teleop_control.recording.mcap_writer import Index, McapWriter
from haptic_teleop_control.recording.merge import Stream, merged_chunks
from haptic_teleop_control.recording.series import NANOSECONDS, JointStateSeries
from haptic_teleop_control.recording.texts import LATCHED_PROFILE, STRING_TYPE, encode_text

CHUNK_BYTES = 768 * 1024
CHUNK_NANOSECONDS = NANOSECONDS
COMPRESSIONS = ("", "zstd")


class RecordingWriter:
    """A new recording at ``path``, a directory that must not exist; use it in a ``with`` statement.

    Messages are collected in chunks of at most one second or 768 kB, so a killed writer loses no more; with
    ``durable`` a chunk is on the disk, not only with the system, before the next begins. ``numbered`` appends
    _2, _3, ... to the name where it is taken. ``path`` is then where the recording lies, ``counts`` the
    messages by topic. ``steady`` is the clock that `flush_older` goes by, ns. Raises RecordingError: the
    directory exists or cannot be made, the disk is full, or the
    writer is closed.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        parameters: Mapping[str, Any] | None = None,
        experiment: Mapping[str, Any] | None = None,
        compression: str = "",
        durable: bool = False,
        numbered: bool = False,
        steady: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        if compression not in COMPRESSIONS:
            raise RecordingError(f"compression {compression!r} is not known: choose 'zstd', or '' for none")
        self.path = _make_directory(Path(path), numbered)
        self.counts: dict[str, int] = {}
        self._custom: dict[str, str] = {}
        self._topics: dict[str, tuple[int, TopicEntry]] = {}
        self._closed = False
        self._steady = steady
        self._empty_chunk()
        with self._refusals():
            self._file = McapWriter(self.path / f"{self.path.name}_0.mcap", compression, durable)
        self.describe(parameters=parameters, experiment=experiment)

    def describe(self, **content: Mapping[str, Any] | None) -> None:
        """Sets ``parameters``, ``parameters_at_stop``, ``models``, ``experiment`` or ``reception``; None
        leaves one as it is.

        It is written into the file at once, so that a recording whose writer is killed still knows it.
        """
        for key, value in content.items():
            if key not in KEYS:
                raise ValueError(f"{key} is none of {KEYS}")
            if value is not None:
                self._custom[f"{SELF_DESCRIPTION}.{key}"] = _json(value)
        if any(value is not None for value in content.values()):
            with self._refusals():
                self._file.add_metadata(SELF_DESCRIPTION, self._custom)

    def add_topic(
        self,
        topic: str,
        kind: str,
        definition: str | None = None,
        hash_: str | None = None,
        qos: Sequence[dict[str, Any]] = (),
    ) -> None:
        """Announces a topic of message type ``kind``; not needed for types of the ROS distributions.

        ``qos`` are the profiles offered by its publishers, as rosbag2 writes them.
        """
        text, rihs = message_definition(kind)
        text, rihs = definition or text, hash_ or rihs
        with self._refusals():
            known = next((s.id for s in self._file.schemas if s.name == kind), None)
            schema = known or self._file.add_schema(kind, "ros2msg" if text else "", text)
            profiles = yaml.safe_dump(list(qos), sort_keys=False) if qos else ""
            about = {"offered_qos_profiles": profiles, "topic_type_hash": rihs}
            channel = self._file.add_channel(topic, "cdr", schema, about)
        self._topics[topic] = (channel, TopicEntry(topic, kind, rihs, list(qos)))
        self.counts[topic] = 0

    def write(
        self,
        topic: str,
        kind: str,
        received: int,
        data: bytes | memoryview,
        published: int | None = None,
        sequence: int = 0,
    ) -> None:
        """Adds one serialised message: ``received`` (log time) and ``published``, ns since 1970, default the
        same."""
        if topic not in self._topics:
            self.add_topic(topic, kind)
        if self._body and (
            len(self._body) + len(data) > CHUNK_BYTES or received - self._chunk_start >= CHUNK_NANOSECONDS
        ):
            self.flush()
        if not self._body:
            self._chunk_start = received
            self._chunk_begun = self._steady()
        number = self._topics[topic][0]
        times, offsets = self._index.setdefault(number, ([], []))
        times.append(received)
        offsets.append(len(self._body))
        published = received if published is None else published
        self._body += MESSAGE_HEAD.pack(5, 22 + len(data), number, sequence, received, published)
        self._body += data
        self.counts[topic] += 1

    def write_series(self, series: Mapping[str, JointStateSeries]) -> None:
        """Adds the messages of whole topics at once, in the order in which they were received."""
        self.flush()
        streams: list[Stream] = []
        for topic, one in series.items():
            if topic not in self._topics:
                self.add_topic(topic, JOINT_STATE_TYPE)
            if len(one):
                streams.append(Stream(self._topics[topic][0], one.received, one.stamp, encode(one)))
            self.counts[topic] += len(one)
        if not streams:
            return
        for data, index in merged_chunks(streams, CHUNK_BYTES, CHUNK_NANOSECONDS):
            with self._refusals():
                self._file.add_chunk(data, index)

    def flush_older(self) -> None:
        """Ends the chunk in progress when it was begun a second ago or earlier, by the steady clock: times of
        reception may be simulated, and a wall clock may be set back."""
        if self._body and self._steady() - self._chunk_begun >= CHUNK_NANOSECONDS:
            self.flush()

    def flush(self) -> None:
        """Ends the chunk in progress and hands it to the system."""
        if self._closed:
            raise RecordingError(f"{self.path}: the recording is closed: open a new one")
        if not self._body:
            return
        body, lists = bytes(self._body), self._index
        self._empty_chunk()
        index = {c: Index(np.array(t, np.uint64), np.array(o, np.uint64)) for c, (t, o) in lists.items()}
        with self._refusals():
            self._file.add_chunk(body, index)

    def close(self) -> None:
        """Ends the recording: writes the last chunk, the summary and metadata.yaml. Twice does no harm."""
        if self._closed:
            return
        try:
            self.flush()
        finally:
            self._closed = True
            with self._refusals():
                try:
                    self._file.finish()
                    self._write_metadata()
                finally:
                    self._file.abandon()

    def __enter__(self) -> RecordingWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()  # after an error too: what was recorded is worth keeping

    @contextmanager
    def _refusals(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            reason = error.strerror or str(error)
            raise RecordingError(
                f"{self.path}: cannot be written ({reason}): free space there or choose another output"
            ) from error

    def _empty_chunk(self) -> None:
        self._body = bytearray()
        self._index: dict[int, tuple[list[int], list[int]]] = {}
        self._chunk_start = self._chunk_begun = 0

    def _write_metadata(self) -> None:
        entries = [(entry, self._file.counts[number]) for number, entry in self._topics.values()]
        information = bag_information(self._file.path.name, self._file.span, entries, self._custom)
        text = yaml.safe_dump({"rosbag2_bagfile_information": information}, sort_keys=False, width=10**6)
        scratch = self.path / f"{METADATA}.tmp"
        scratch.write_text(text)
        scratch.replace(self.path / METADATA)


def write_recording(
    path: str | Path,
    topics: Mapping[str, JointStateSeries],
    parameters: Mapping[str, Any] | None = None,
    experiment: Mapping[str, Any] | None = None,
    *,
    models: Mapping[str, str] | None = None,
    texts: Mapping[str, Sequence[tuple[int, str]]] | None = None,
    compression: str = "",
    numbered: bool = False,
) -> Path:
    """Writes a whole recording at once, in the layout of the recorder's; returns where it lies.

    ``received`` of each series is the time of reception, not negative. models: path -> text of the model
    files that ``parameters`` name. texts: topic -> (time of reception ns,
    text) of latched std_msgs/String, in order of time. Raises RecordingError like RecordingWriter.
    """
    for topic, series in topics.items():
        if len(series) and int(series.received.min()) < 0:
            raise RecordingError(f"{path}: {topic} has a negative time of reception: shift its times")
    with RecordingWriter(
        path, parameters=parameters, experiment=experiment, compression=compression, numbered=numbered
    ) as writer:
        writer.describe(models=models)
        for topic, said in (texts or {}).items():
            writer.add_topic(topic, STRING_TYPE, qos=[LATCHED_PROFILE])
            for received, text in said:
                writer.write(topic, STRING_TYPE, received, encode_text(text))
        writer.write_series(topics)
    return writer.path


def _json(value: Mapping[str, Any]) -> str:
    """The object as JSON that any reader takes: no limit and no number is `.inf` and `.nan`, in quotes, as in
    ROS parameters, because JSON has neither."""

    def plain(part: object) -> object:
        if isinstance(part, Mapping):
            return {str(key): plain(one) for key, one in part.items()}
        if isinstance(part, (list, tuple)):
            return [plain(one) for one in part]
        if isinstance(part, float) and not math.isfinite(part):
            return ".nan" if math.isnan(part) else ".inf" if part > 0.0 else "-.inf"
        return part

    return json.dumps(plain(value), default=str, allow_nan=False)


def _make_directory(path: Path, numbered: bool) -> Path:
    wanted, number = path, 1
    while True:
        try:
            path.mkdir(parents=True)
            return path
        except FileExistsError:
            if not numbered:
                raise RecordingError(
                    f"{path}: it exists already and is not overwritten: name another output, or remove it"
                ) from None
            number += 1
            path = wanted.with_name(f"{wanted.name}_{number}")
        except OSError as error:
            reason = error.strerror or str(error)
            raise RecordingError(
                f"{path}: cannot be made ({reason}): choose another output directory"
            ) from error
