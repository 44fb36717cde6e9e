"""An MCAP file written chunk by chunk, each with checksum and index and handed to the system as soon as it is
full.

The mcap library's writer costs about ten times the time for each message, and flushes only when asked; so
chunks are put together here, and every other record is written by the library's record classes.
"""

from __future__ import annotations

import os
import struct
import zlib
from pathlib import Path
from typing import NamedTuple

import numpy as np
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from numpy.typing import NDArray

from haptic_teleop_control.recording.mcap_records import MAGIC, RECORD_HEAD

LIBRARY = "haptic_teleop_control"


class Index(NamedTuple):
    """Log times (ns) and offsets in the chunk of a channel's messages, (m,) each."""

    times: NDArray[np.uint64]
    offsets: NDArray[np.uint64]


class McapWriter:
    """Writes ``path``, which must not exist. ``durable`` waits after each chunk until the disk has it.

    All methods raise OSError when the disk refuses; what was refused is then cut off, so that the file ends
    with a whole record and ``finish`` can still be tried.
    """

    def __init__(self, path: Path, compression: str = "", durable: bool = False) -> None:
        self.path, self.compression, self.durable = path, compression, durable
        self.size = 0
        self.schemas: list[Schema] = []
        self.channels: list[Channel] = []
        self.counts: dict[int, int] = {}
        self._chunks: list[ChunkIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._crc = 0
        self.span: tuple[int, int] | None = None
        self._file = path.open("xb", buffering=0)
        self._put(MAGIC)
        self._record(Header("ros2", LIBRARY))

    def add_schema(self, name: str, encoding: str, text: str) -> int:
        """The number of a new schema. Like a channel it is written outside of chunks, so that it outlives
        them."""
        schema = Schema(len(self.schemas) + 1, text.encode(), encoding, name)
        self._record(schema)
        self.schemas.append(schema)
        return schema.id

    def add_channel(self, topic: str, encoding: str, schema: int, metadata: dict[str, str]) -> int:
        """The number of a new channel."""
        channel = Channel(len(self.channels) + 1, topic, encoding, metadata, schema)
        self._record(channel)
        self.channels.append(channel)
        self.counts[channel.id] = 0
        return channel.id

    def add_metadata(self, name: str, content: dict[str, str]) -> None:
        """Writes a metadata record."""
        start = self.size
        self._record(Metadata(name, content))
        self._metadata.append(MetadataIndex(start, self.size - start, name))

    def add_chunk(self, data: bytes, index: dict[int, Index]) -> None:
        """Writes whole message records as one chunk; ``index`` says where each channel's messages are in
        it."""
        start = min(int(one.times.min()) for one in index.values())
        end = max(int(one.times.max()) for one in index.values())
        stored = zstandard.ZstdCompressor(level=1).compress(data) if self.compression == "zstd" else data
        head = RecordBuilder()
        Chunk(self.compression, stored, end, start, zlib.crc32(data), len(data)).write(head)
        chunk = head.end()
        at, before = len(chunk), self.size
        offsets: dict[int, int] = {}
        indices = b""
        for channel, one in index.items():
            offsets[channel] = before + at + len(indices)
            pairs = np.stack((one.times, one.offsets), axis=1).astype("<u8").tobytes()
            indices += RECORD_HEAD.pack(Opcode.MESSAGE_INDEX, 6 + len(pairs)) + struct.pack(
                "<HI", channel, len(pairs)
            )
            indices += pairs
        self._put(chunk + indices)
        if self.durable:
            os.fdatasync(self._file.fileno())
        for channel, one in index.items():
            self.counts[channel] += len(one.times)
        self._chunks.append(
            ChunkIndex(
                at, before, self.compression, len(stored), end, len(indices), offsets, start, len(data)
            )
        )
        self.span = (start, end) if self.span is None else (min(self.span[0], start), max(self.span[1], end))

    def finish(self) -> None:
        """Writes the summary and closes the file."""
        self._record(DataEnd(self._crc))
        summary_start = self.size
        start, end = self.span or (0, 0)
        statistics = Statistics(
            attachment_count=0,
            channel_count=len(self.channels),
            channel_message_counts=self.counts,
            chunk_count=len(self._chunks),
            message_count=sum(self.counts.values()),
            message_end_time=end,
            message_start_time=start,
            metadata_count=len(self._metadata),
            schema_count=len(self.schemas),
        )
        builder = RecordBuilder()
        groups: list[SummaryOffset] = []
        kinds: list[tuple[int, list]] = [
            (Opcode.SCHEMA, self.schemas),
            (Opcode.CHANNEL, self.channels),
            (Opcode.STATISTICS, [statistics]),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.METADATA_INDEX, self._metadata),
        ]
        for opcode, records in kinds:
            group = builder.count
            for record in records:
                record.write(builder)
            if records:
                groups.append(SummaryOffset(opcode, summary_start + group, builder.count - group))
        offsets_start = summary_start + builder.count
        for one in groups:
            one.write(builder)
        summary = builder.end()
        footer = RECORD_HEAD.pack(Opcode.FOOTER, 20) + struct.pack("<QQ", summary_start, offsets_start)
        crc = zlib.crc32(summary + footer)
        Footer(summary_start, offsets_start, crc).write(builder)
        self._put(summary + builder.end() + MAGIC)
        os.fdatasync(self._file.fileno())
        self._file.close()

    def abandon(self) -> None:
        """Closes the file as it is, without a summary."""
        self._file.close()

    def _record(self, record: McapRecord) -> None:
        builder = RecordBuilder()
        record.write(builder)
        self._put(builder.end())

    def _put(self, data: bytes) -> None:
        rest = memoryview(data)
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError:
            self._file.truncate(self.size)
            self._file.seek(self.size)
            raise
        self.size += len(data)
        self._crc = zlib.crc32(data, self._crc)
