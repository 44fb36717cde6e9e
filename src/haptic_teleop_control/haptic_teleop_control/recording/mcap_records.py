"""The message records of an MCAP chunk as arrays, and a chunk's contents checked and decompressed.

Format: MCAP specification 1.0. All records but messages and chunks are read and written by the mcap library;
these two carry all the data, so they are handled in bulk here.
"""

from __future__ import annotations

import struct
import zlib
from io import BytesIO
from typing import NamedTuple, TypeVar

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, Footer, Header, Metadata, Schema, Statistics
from numpy.typing import NDArray

from haptic_teleop_control.recording.expansion import MAX_CHUNK, Budget, Damaged, expand_chunk

MAGIC = b"\x89MCAP0\r\n"
RECORD_HEAD = struct.Struct("<BQ")  # opcode, length of what follows
MESSAGE_HEAD = struct.Struct("<BQHIQQ")  # ..., channel, sequence, log time, publish time; then the message
_WALK = struct.Struct("<BQH")
_CHUNK_HEAD = struct.Struct(
    "<QQQII"
)  # start, end, size and checksum of the contents, length of the compression's name

Parsed = TypeVar("Parsed", Channel, ChunkIndex, Footer, Header, Metadata, Schema, Statistics)


class Messages(NamedTuple):
    """m message records in ``data``: channel, offset of the record, and length of the record with its head,
    (m,)."""

    data: bytes
    channel: NDArray[np.intp]
    offset: NDArray[np.intp]
    size: NDArray[np.intp]

    def rows(self, which: NDArray[np.intp]) -> NDArray[np.uint8]:
        """The records ``which``, all of one size, as rows of a matrix (head of 31 bytes, then the
        message)."""
        size = int(self.size[which[0]])
        # Each byte starts a window of `size` bytes taken as one item, so that a record is copied in one
        # piece.
        windows = np.ndarray((len(self.data) - size + 1,), f"V{size}", self.data, 0, (1,))
        return windows[self.offset[which]].view(np.uint8).reshape(len(which), size)


class Walk(NamedTuple):
    """What lies in a run of records, and where the first that could not be taken starts."""

    messages: Messages
    schemas: list[Schema]
    channels: list[Channel]
    end: int


def parse(kind: type[Parsed], body: bytes) -> Parsed:
    """The record of that kind with that body; Damaged when it is not one."""
    try:
        return kind.read(ReadDataStream(BytesIO(body)))
    except Exception as error:  # the library lets struct, Unicode and end-of-file errors through
        raise Damaged(f"a {kind.__name__.lower()} record cannot be read") from error


def walk(data: bytes) -> Walk:
    """Follows schema, channel and message records from the start of ``data`` as far as they are whole."""
    channel: list[int] = []
    offset: list[int] = []
    size: list[int] = []
    schemas: list[Schema] = []
    channels: list[Channel] = []
    at, end, unpack = 0, len(data), _WALK.unpack_from
    while at + _WALK.size <= end:
        opcode, length, identity = unpack(data, at)
        following = at + 9 + length
        if following > end:
            break
        if opcode == 5:
            if length < 22:
                break
            channel.append(identity)
            offset.append(at)
            size.append(9 + length)
        elif opcode == Opcode.SCHEMA:
            schemas.append(parse(Schema, data[at + 9 : following]))
        elif opcode == Opcode.CHANNEL:
            channels.append(parse(Channel, data[at + 9 : following]))
        else:
            break
        at = following
    messages = Messages(data, np.array(channel, np.intp), np.array(offset, np.intp), np.array(size, np.intp))
    return Walk(messages, schemas, channels, at)


class Chunk(NamedTuple):
    """The head of a chunk: times of its messages, size and checksum of its contents, how and where they are
    stored."""

    start: int
    end: int
    size: int
    crc: int
    compression: str
    data_at: int
    data_size: int


def chunk_head(body: bytes) -> Chunk:
    """The head of the chunk record with that body, which may be cut after it; Damaged when it makes no
    sense."""
    try:
        start, end, size, crc, length = _CHUNK_HEAD.unpack_from(body)
        compression = body[_CHUNK_HEAD.size : _CHUNK_HEAD.size + length].decode()
        (data_size,) = struct.unpack_from("<Q", body, _CHUNK_HEAD.size + length)
    except (struct.error, UnicodeDecodeError):
        raise Damaged("its head cannot be read") from None
    if compression not in ("", "zstd", "lz4") or (not compression and size > MAX_CHUNK):
        raise Damaged("its head makes no sense")
    return Chunk(start, end, size, crc, compression, _CHUNK_HEAD.size + length + 8, data_size)


def chunk_contents(chunk: Chunk, body: bytes, budget: Budget) -> bytes:
    """The decompressed records of a chunk; Damaged when they are not whole, are more than they may be, or
    fail the checksum; TooLarge when `budget`, that of the file, is used up."""
    stored = body[chunk.data_at : chunk.data_at + (chunk.data_size if chunk.compression else chunk.size)]
    if chunk.compression:
        stored = expand_chunk(chunk.compression, stored, chunk.size, budget)
    if len(stored) != chunk.size:
        raise Damaged("it is not whole")
    if chunk.crc and zlib.crc32(stored) != chunk.crc:
        raise Damaged("it fails its checksum")
    return stored
