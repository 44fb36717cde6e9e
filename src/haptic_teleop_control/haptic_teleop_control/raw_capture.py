"""Raw packets of a device with their times, as they passed: written while a driver runs, read for a replay.

A capture is one MCAP file with the channels

    read      bytes that came from the device       write    bytes that went to it
    command   float64 efforts given to the driver, little-endian; no bytes: none was permitted.
              Its time is the stamp of the state that it answers
    reset     a fault was reset; the byte says whether the device was opened again

in the order in which they happened, and the metadata record `haptic_teleop.capture` with the robot's name and
the driver's parameters as JSON. So a session can go through codec and driver once more.
"""

from __future__ import annotations

import json
import queue
import struct
import threading
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from mcap.exceptions import McapError
from mcap.records import Channel, Chunk, McapRecord, Message, Metadata
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import CompressionType, Writer

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_control.recording.expansion import Budget, Damaged, expand_chunk

READ, WRITE, COMMAND, RESET = "read", "write", "command", "reset"
_METADATA = "haptic_teleop.capture"
_QUEUE = 20_000  # packets: some seconds of both directions at 1 kHz


@dataclass(frozen=True)
class Packet:
    """stamp: ns. channel: read, write, command or reset."""

    stamp: int
    channel: str
    data: bytes


class RawCapture:
    """Writes packets to `path`, which must not exist; a thread of its own does the disk's part.

    `dropped` counts packets for which there was no room because the disk did not keep up.
    Raises RecordingError when the file cannot be made.
    """

    def __init__(self, path: str | Path, robot: str, parameters: Mapping[str, Any]) -> None:
        self.path = Path(path)
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._file = self.path.open("xb")
        except OSError as refusal:
            raise RecordingError(
                f"{path}: the capture cannot be written ({refusal.strerror}); name a new file."
            ) from refusal
        self.dropped = 0
        self.failure: OSError | None = None
        self._packets: queue.Queue[Packet | None] = queue.Queue(_QUEUE)
        self._writer = Writer(self._file, chunk_size=64 * 1024, compression=CompressionType.NONE)
        self._writer.start(profile="", library="haptic_teleop")
        self._writer.add_metadata(_METADATA, {"robot": robot, "parameters": json.dumps(dict(parameters))})
        self._channels = {
            name: self._writer.register_channel(topic=name, message_encoding="raw", schema_id=0)
            for name in (READ, WRITE, COMMAND, RESET)
        }
        self._thread = threading.Thread(target=self._write_all, name="capture", daemon=True)
        self._thread.start()

    def add(self, channel: str, stamp: int, data: bytes) -> None:
        """Queues a packet; costs microseconds and never waits."""
        try:
            self._packets.put_nowait(Packet(stamp, channel, data))
        except queue.Full:
            self.dropped += 1

    def close(self) -> None:
        """Writes what is queued and ends the file; a second call does nothing."""
        while self._thread.is_alive():
            with suppress(queue.Full):  # of a queue that a full disk has just left behind
                self._packets.put(None, timeout=1.0)
                self._thread.join()

    def _write_all(self) -> None:
        sequence = 0
        try:
            while (packet := self._packets.get()) is not None:
                sequence += 1
                self._writer.add_message(
                    self._channels[packet.channel], packet.stamp, packet.data, packet.stamp, sequence
                )
            self._writer.finish()
        except OSError as failure:  # a full disk must not stop a robot
            self.failure = failure
        finally:
            self._file.close()
            # Whoever still adds must find room, and `close` must not wait for a thread that is gone.
            self._packets = queue.Queue(_QUEUE)


@dataclass(frozen=True)
class Capture:
    """A capture read back. complete: False when its writer was killed or the file is damaged; what is whole
    before that place is there then. problem: what is known of the damage, or nothing."""

    robot: str
    parameters: dict[str, Any]
    packets: list[Packet]
    complete: bool
    problem: str = ""


def read_capture(path: str | Path, robot: str) -> Capture:
    """The capture of a session with `robot`. Raises RecordingError naming the file and the remedy."""
    path = Path(path)
    packets: list[Packet] = []
    channels: dict[int, str] = {}
    description: dict[str, str] | None = None
    complete, problem = True, ""
    try:
        with path.open("rb") as file:
            for record in _records(file, Budget(path.stat().st_size)):
                if isinstance(record, Metadata) and record.name == _METADATA:
                    description = record.metadata
                elif isinstance(record, Channel):
                    channels[record.id] = record.topic
                elif isinstance(record, Message):
                    packets.append(Packet(record.log_time, channels[record.channel_id], record.data))
    except OSError as refusal:
        raise RecordingError(
            f"{path}: cannot be read ({refusal.strerror}); give a capture that a driver wrote."
        ) from refusal
    except Damaged as damage:
        complete, problem = False, str(damage)
    except (McapError, EOFError, ValueError, LookupError, OverflowError, MemoryError, struct.error):
        complete = False  # all of them mean bytes that make no sense
    if description is None or "robot" not in description:
        why = f" ({problem})" if problem else ""
        raise RecordingError(f"{path}: is no capture of raw packets{why}; give a file that a driver wrote.")
    if description["robot"] != robot:
        raise RecordingError(
            f"{path}: is a capture of {description['robot']}; give one of {robot}, or use the other driver."
        )
    try:
        parameters = dict(json.loads(description["parameters"]))
    except (KeyError, TypeError, ValueError) as damage:
        raise RecordingError(
            f"{path}: haptic_teleop.capture: its parameters cannot be read; give a file that is not damaged."
        ) from damage
    return Capture(robot, parameters, packets, complete, problem)


def _records(file: BinaryIO, budget: Budget) -> Iterator[McapRecord]:
    """The library's records, but it decompresses chunks without limit: so that is done here. Damaged where a
    chunk expands to more than it may."""
    number = 0
    for record in StreamReader(file, validate_crcs=True, emit_chunks=True).records:
        if not isinstance(record, Chunk):
            yield record
            continue
        number += 1
        if record.compression in ("zstd", "lz4"):
            try:
                size = record.uncompressed_size
                record.data = expand_chunk(record.compression, record.data, size, budget)
            except Damaged as damage:
                raise Damaged(f"chunk {number}: {damage}") from None
            record.compression = ""
        yield from breakup_chunk(record, validate_crc=True)
