"""Decompression with limits: a small file must not become any amount of memory or of disk.

What a recorder writes shrinks some ten to fifty times; a file that is made to harm, thirty thousand times.
So a part may expand to PART_BYTES, or to RATIO times what it takes where that is more; and all parts of a
file together to FILE_BYTES, or to RATIO times the file. rosbag2's chunks have 0.8 to 4 MB, its files any
size.
"""

from __future__ import annotations

import bz2
from collections.abc import Iterator
from typing import BinaryIO, Protocol

import lz4.frame
import zstandard

RATIO = 200
PART_BYTES = 64 << 20
MAX_CHUNK = 1 << 30
FILE_BYTES = 1 << 30
REMEDY = "if that is right, rewrite the recording without compression, with the tool that made it"
_BLOCK = 1 << 20


class Damaged(Exception):
    """A part of the file is not what it says; the message is the end of a sentence about it."""


class TooLarge(Damaged):
    """The file as a whole would expand beyond what is allowed; reading it ends here."""


class Budget:
    """How much the parts of one file, which takes `stored` bytes on the disk, may still expand to."""

    def __init__(self, stored: int) -> None:
        self.limit = self.left = max(FILE_BYTES, RATIO * stored)

    def take(self, size: int) -> None:
        """Uses up `size` bytes; TooLarge when they are not there."""
        if size > self.left:
            raise TooLarge(
                f"would make more than {megabytes(self.limit)} of what the file holds, which is all that is "
                f"taken of a file of its size: {REMEDY}"
            )
        self.left -= size


def megabytes(size: int) -> str:
    """`size` bytes as text."""
    return f"{size / 1e6:.3g} MB" if size >= 1e6 else f"{size} bytes"


def part_limit(stored: int) -> int:
    """To how many bytes a chunk or message of `stored` bytes may expand."""
    return min(MAX_CHUNK, max(PART_BYTES, RATIO * stored))


def expand_chunk(compression: str, stored: bytes, size: int, budget: Budget) -> bytes:
    """The contents of a chunk that announces `size` bytes, compressed by "zstd", "lz4" or "bz2". Damaged when
    it announces or holds more than it may; TooLarge from `budget`."""
    _check(size, len(stored))
    budget.take(size)
    try:
        # One byte more than announced, so that a longer one shows; asking for the size from the frame itself
        # could ask for any amount of memory.
        if compression == "zstd":
            contents = zstandard.ZstdDecompressor().stream_reader(stored).read(size + 1)
        elif compression == "bz2":
            contents = bz2.BZ2Decompressor().decompress(stored, size + 1)
        else:
            contents = lz4.frame.LZ4FrameDecompressor().decompress(stored, max_length=size + 1)
    except (zstandard.ZstdError, RuntimeError, OSError, ValueError, MemoryError) as error:
        raise Damaged("it cannot be decompressed") from error
    if len(contents) > size:
        raise Damaged(f"it holds more than the {size} bytes that it announces")
    return contents


def expand_message(stored: bytes, budget: Budget) -> bytes:
    """A message compressed by itself with zstd. Damaged when it cannot be decompressed or holds more than it
    may; TooLarge from `budget`."""
    contents = bytearray()
    try:
        announced = zstandard.frame_content_size(stored)  # -1 where the frame does not say
        _check(announced, len(stored))
        block_size = min(_BLOCK, announced + 1) if announced >= 0 else _BLOCK
        for block in _blocks(zstandard.ZstdDecompressor().stream_reader(stored), block_size):
            contents += block
            _check(len(contents), len(stored))
            budget.take(len(block))
    except (zstandard.ZstdError, MemoryError) as error:
        raise Damaged("it cannot be decompressed") from error
    return bytes(contents)


def expand_file(packed: BinaryIO, target: BinaryIO, budget: Budget) -> None:
    """Writes what a file holds that is compressed with zstd as a whole; errors as `expand_message`."""
    try:
        budget.take(max(0, zstandard.frame_content_size(packed.read(32))))  # without a byte written
        packed.seek(0)
        announced = budget.limit - budget.left
        for block in _blocks(zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True)):
            known = min(announced, len(block))
            announced -= known
            budget.take(len(block) - known)
            target.write(block)
    except TooLarge as refusal:
        raise TooLarge(f"it {refusal}") from None
    except zstandard.ZstdError:
        raise Damaged("it cannot be decompressed") from None


class _Reader(Protocol):
    def read(self, size: int, /) -> bytes: ...


def _blocks(reader: _Reader, size: int = _BLOCK) -> Iterator[bytes]:
    while block := reader.read(size):
        yield block


def _check(size: int, stored: int) -> None:
    limit = part_limit(stored)
    if size > limit:
        raise Damaged(
            f"its {stored} bytes would expand to {megabytes(size)}, and at most {megabytes(limit)} are "
            f"taken: {REMEDY}"
        )
