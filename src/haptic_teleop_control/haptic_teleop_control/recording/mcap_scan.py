"""An MCAP file from front to back, whatever its state: all messages that are whole, and a sentence for each
damage.

The file is followed record by record, so a file without the closing summary (its writer was killed) is read
like any other. Where a length is wrong, the summary's list of chunks, if there is one, tells where to go on.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.records import Channel, Metadata, Schema

from haptic_teleop_control.recording.expansion import Budget, Damaged, TooLarge
from haptic_teleop_control.recording.mcap_records import (
    MAGIC,
    RECORD_HEAD,
    Messages,
    chunk_contents,
    chunk_head,
    parse,
    walk,
)
from haptic_teleop_control.recording.mcap_summary import Summary, read_summary

BLOCK = 4 << 20
KNOWN = range(Opcode.HEADER, Opcode.DATA_END + 1)
PRIVATE = range(128, 256)  # records of other makers, to be passed over


class McapScan:
    """Iterate over it for the messages, chunk by chunk; the attributes are complete after that.

    schemas, channels   by their number, from wherever the file holds them
    metadata            metadata records in the order of the file
    problems            sentences; empty exactly when the file is whole
    lost                (start, end) ns of the chunks that could not be read

    budget: what the file's chunks may expand to; that of a file of this size when it is not given.
    Raises Damaged when the file is no MCAP file at all, OSError when it cannot be read.
    """

    def __init__(self, file: BinaryIO, budget: Budget | None = None) -> None:
        self.file = file
        self.size = file.seek(0, 2)
        self.budget = Budget(self.size) if budget is None else budget
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.metadata: list[Metadata] = []
        self.problems: list[str] = []
        self.lost: list[tuple[int, int]] = []
        self.count = 0
        self._summary = Summary()
        self._reached = 0
        self._number = 0
        self._start: int | None = None
        if not self.size:
            raise Damaged("it is empty")
        head = self._read(0, 9)
        if head[:8] != MAGIC:
            if head[8:] != bytes([Opcode.HEADER]):
                raise Damaged("it is not an MCAP file")
            self.problems.append("its first bytes are damaged")

    def type_of(self, channel: int) -> str | None:
        """The message type of a channel; None when the file lost what the channel is."""
        known = self.channels.get(channel)
        schema = self.schemas.get(known.schema_id) if known else None
        return schema.name if schema else None

    def definition_of(self, kind: str) -> tuple[str, str]:
        """Encoding and text of the first schema that defines a message type; both empty when none does."""
        schemas = (one for one in self.schemas.values() if one.name == kind and one.data)
        found = next(schemas, None)
        return (found.encoding, found.data.decode(errors="replace")) if found else ("", "")

    def __iter__(self) -> Iterator[Messages]:
        summary = read_summary(self._read, self.size)
        self._summary = summary
        self._learn(summary.schemas, summary.channels)
        at: int | None = len(MAGIC)
        ended = False
        refused = False
        while at is not None:
            head = self._read(at, RECORD_HEAD.size)
            self._reached = at
            if len(head) < RECORD_HEAD.size:
                break
            opcode, length = RECORD_HEAD.unpack(head)
            if opcode == Opcode.DATA_END and at + 9 + length <= self.size:
                ended = True
                break
            if opcode in (Opcode.MESSAGE, Opcode.SCHEMA, Opcode.CHANNEL):
                messages, at = self._take_run(at, length)
            elif opcode == Opcode.CHUNK:
                try:
                    messages, at = self._take_chunk(at, length)
                except TooLarge as refusal:
                    self.problems.append(f"chunk {self._number} at byte {at} {refusal}; the rest is left out")
                    refused, messages, at = True, None, None
            else:
                messages, at = None, self._pass_over(at, opcode, length)
            if messages is not None and len(messages.channel):
                self.count += len(messages.channel)
                yield messages
        if refused:
            return
        if not ended and not summary.trusted:
            rest = self.size - self._reached
            self.problems.append(
                "it has no closing part (its writer was stopped before it closed it, or it was cut)"
                + (f", and its last {rest} bytes are no whole record" if rest else "")
            )
        elif summary.problem:
            self.problems.append(summary.problem)
        if summary.announced is not None and summary.announced != self.count:
            self.problems.append(
                f"it holds {self.count} of the {summary.announced} messages that it announces"
            )

    def _read(self, at: int, length: int) -> bytes:
        if at >= self.size:
            return b""
        self.file.seek(at)
        return self.file.read(min(length, self.size - at))

    def _go_on_after(self, at: int, reason: str) -> int | None:
        """The next chunk after damage at ``at``, by the summary; None when nothing tells where it is."""
        following = min(
            (c.chunk_start_offset for c in self._summary.chunks if c.chunk_start_offset > at), default=None
        )
        rest = "the rest is lost" if following is None else f"it goes on at byte {following}"
        self.problems.append(f"at byte {at} {reason}: {rest}")
        return following

    def _too_long(self, at: int) -> int | None:
        # Without a summary this is how a cut file ends, and that is told once, at the end.
        return self._go_on_after(at, "a record is longer than the file") if self._summary.trusted else None

    def _pass_over(self, at: int, opcode: int, length: int) -> int | None:
        if opcode not in KNOWN and opcode not in PRIVATE:
            return self._go_on_after(at, f"no record has the code {opcode}")
        if at + 9 + length > self.size:
            return self._too_long(at)
        if opcode == Opcode.METADATA:
            try:
                self.metadata.append(parse(Metadata, self._read(at + 9, length)))
            except Damaged as damage:
                self.problems.append(f"at byte {at} {damage}")
        return at + 9 + length

    def _take_run(self, at: int, length: int) -> tuple[Messages | None, int | None]:
        """Records that lie in the file outside of chunks."""
        data = self._read(at, max(BLOCK, 9 + length))
        try:
            found = walk(data)
        except Damaged as damage:
            return None, self._go_on_after(at, str(damage))
        self._learn(found.schemas, found.channels)
        if found.end == 0:
            return None, self._too_long(at)
        return found.messages, at + found.end

    def _take_chunk(self, at: int, length: int) -> tuple[Messages | None, int | None]:
        self._number += 1
        end = at + 9 + length
        body = self._read(at + 9, length)
        try:
            chunk = chunk_head(body)
        except Damaged as damage:
            if end > self.size:
                return None, self._too_long(at)
            return None, self._go_on_after(at, f"chunk {self._number}: {damage}")
        # The length of the contents is said twice; where the two differ, one is damaged.
        inner = chunk.data_at + (chunk.data_size if chunk.compression else chunk.size)
        sound = end <= self.size and inner == length
        if inner > length:
            body = self._read(at + 9, inner)
        try:
            found = walk(chunk_contents(chunk, body, self.budget))
        except TooLarge:
            self.lost.append((chunk.start, chunk.end))
            raise
        except Damaged as damage:
            if not sound and not chunk.compression:
                return self._take_cut_chunk(at, body[chunk.data_at : chunk.data_at + chunk.size], str(damage))
            self._lose(at, chunk.start, chunk.end, str(damage))
            if sound:
                return None, end
            return None, self._go_on_after(at, "a chunk has a wrong length") if end <= self.size else None
        self._start = chunk.start if self._start is None else self._start
        self._learn(found.schemas, found.channels)
        what = f"chunk {self._number} at byte {at}"
        if found.end < chunk.size:
            self.problems.append(f"{what} holds {chunk.size - found.end} bytes that are no messages")
        if not sound:
            self.problems.append(f"{what} has a wrong length; its messages are whole")
            end = next((place for place in (at + 9 + inner, end) if self._is_record(place)), self.size)
        return found.messages, end

    def _is_record(self, at: int) -> bool:
        head = self._read(at, RECORD_HEAD.size)
        if len(head) < RECORD_HEAD.size:
            return False
        opcode, length = RECORD_HEAD.unpack(head)
        return opcode in KNOWN and at + RECORD_HEAD.size + length <= self.size

    def _take_cut_chunk(self, at: int, data: bytes, reason: str) -> tuple[Messages | None, int | None]:
        """The whole messages at the start of a chunk that is cut, which has no checksum for a part of it."""
        if self._summary.trusted:  # not cut: the file goes on behind it
            return None, self._go_on_after(at, f"chunk {self._number}: {reason}")
        try:
            found = walk(data)
        except Damaged as damage:
            return None, self._go_on_after(at, f"chunk {self._number}: {damage}")
        self._learn(found.schemas, found.channels)
        self.problems.append(
            f"chunk {self._number} at byte {at} is cut: "
            f"its first {len(found.messages.channel)} messages are taken unchecked"
        )
        return found.messages, None

    def _lose(self, at: int, start: int, end: int, reason: str) -> None:
        origin = start if self._start is None else self._start
        self.lost.append((start, end))
        self.problems.append(
            f"chunk {self._number} at byte {at}, {(start - origin) * 1e-9:.3f} "
            f"to {(end - origin) * 1e-9:.3f} s, is left out: {reason}"
        )

    def _learn(self, schemas: list[Schema], channels: list[Channel]) -> None:
        for schema in schemas:
            self.schemas.setdefault(schema.id, schema)
        for channel in channels:
            self.channels.setdefault(channel.id, channel)
