"""The summary at the end of an MCAP file: what is in it, and where its chunks are."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, field

from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, Footer, Schema, Statistics

from haptic_teleop_control.recording.expansion import Damaged
from haptic_teleop_control.recording.mcap_records import MAGIC, RECORD_HEAD, parse

FOOTER_SIZE = RECORD_HEAD.size + 20


@dataclass
class Summary:
    """What the summary says. ``trusted`` when it is there and its checksum holds, else ``problem`` is a
    sentence; both are empty for a file that was written without one. ``announced``: number of messages in
    the file."""

    trusted: bool = False
    problem: str = ""
    schemas: list[Schema] = field(default_factory=list)
    channels: list[Channel] = field(default_factory=list)
    chunks: list[ChunkIndex] = field(default_factory=list)
    announced: int | None = None


def read_summary(read: Callable[[int, int], bytes], size: int) -> Summary:
    """The summary of a file of ``size`` bytes; ``read(at, length)`` gives its bytes."""
    footer_at = max(0, size - FOOTER_SIZE - len(MAGIC))
    tail = read(footer_at, FOOTER_SIZE + len(MAGIC))
    if len(tail) < FOOTER_SIZE + len(MAGIC) or tail[FOOTER_SIZE:] != MAGIC or tail[0] != Opcode.FOOTER:
        return Summary(problem="its last bytes are damaged or missing; its messages are whole")
    try:
        footer = parse(Footer, tail[RECORD_HEAD.size : FOOTER_SIZE])
        if not footer.summary_start:
            return Summary()
        if footer.summary_start > footer_at:
            raise Damaged("the footer points behind the file")
        data = read(footer.summary_start, footer_at - footer.summary_start)
        # The checksum covers the summary and the footer up to the checksum itself, which takes the last 4
        # bytes.
        if footer.summary_crc and zlib.crc32(data + tail[: FOOTER_SIZE - 4]) != footer.summary_crc:
            raise Damaged("its checksum fails")
        return _parse_summary(data)
    except Damaged as damage:
        return Summary(problem=f"its closing summary is damaged ({damage}); its messages are whole")


def _parse_summary(data: bytes) -> Summary:
    summary = Summary(trusted=True)
    at = 0
    while at + RECORD_HEAD.size <= len(data):
        opcode, length = RECORD_HEAD.unpack_from(data, at)
        body = data[at + RECORD_HEAD.size : at + RECORD_HEAD.size + length]
        at += RECORD_HEAD.size + length
        if opcode == Opcode.SCHEMA:
            summary.schemas.append(parse(Schema, body))
        elif opcode == Opcode.CHANNEL:
            summary.channels.append(parse(Channel, body))
        elif opcode == Opcode.CHUNK_INDEX:
            summary.chunks.append(parse(ChunkIndex, body))
        elif opcode == Opcode.STATISTICS:
            summary.announced = parse(Statistics, body).message_count
    if at != len(data):
        raise Damaged("its records do not fit")
    return summary
