"""Bytes to values and back, as a `Report` says. Decoding takes any bytes and never raises."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping

from haptic_teleop_omni.checksums import CHECKSUMS
from haptic_teleop_omni.layout import TYPES, Field, Report

WRONG_LENGTH, WRONG_ID, WRONG_CHECKSUM = "wrong length", "wrong report number", "wrong checksum"


class ReportCodec:
    """Raw whole numbers by the names of the report's fields; `value` and `raw` convert to and from units."""

    def __init__(self, report: Report) -> None:
        self.report = report
        self._fields = [
            (name, struct.Struct(TYPES[field.type][0]).unpack_from, field.offset, field.shift, _mask(field),
             _mask(field) if field.invert else 0, field.type.startswith("i") and field.mask is None)
            for name, field in report.fields.items()
        ]  # fmt: skip
        self._checksum = CHECKSUMS[report.checksum]
        self.problem: str | None = None

    def decode(self, data: bytes) -> dict[str, int] | None:
        """Raw values, or None for bytes that are no such report; `problem` then says why."""
        report = self.report
        if len(data) != report.length:
            self.problem = WRONG_LENGTH
            return None
        if report.report_id is not None and data[0] != report.report_id:
            self.problem = WRONG_ID
            return None
        if self._checksum is not None and self._checksum(data[:-1]) != data[-1]:
            self.problem = WRONG_CHECKSUM
            return None
        values = {}
        for name, unpack, offset, shift, mask, inverted, signed in self._fields:
            word = unpack(data, offset)[0] >> shift
            values[name] = word if signed else (word & mask) ^ inverted
        return values

    def encode(self, values: Mapping[str, int]) -> bytes:
        """A report with these raw values, each brought between its limits; fields not given are idle."""
        report = self.report
        data = bytearray(report.length)
        for offset, value in report.constants:
            data[offset] = value
        if report.report_id is not None:
            data[0] = report.report_id
        for name, field in report.fields.items():
            low, high = field.limits
            raw = min(max(int(values.get(name, field.idle)), low), high)
            packer = struct.Struct(TYPES[field.type][0])
            if field.mask is None and not field.shift:
                packer.pack_into(data, field.offset, raw)
                continue
            mask = _mask(field)
            raw = (raw ^ mask if field.invert else raw) & mask
            unsigned = struct.Struct(
                TYPES[field.type][0].replace("h", "H").replace("i", "I").replace("b", "B")
            )
            word = unsigned.unpack_from(data, field.offset)[0]
            word = (word & ~(mask << field.shift)) | (raw << field.shift)
            unsigned.pack_into(data, field.offset, word)
        if self._checksum is not None:
            data[-1] = self._checksum(data[:-1])
        return bytes(data)


def value_of(field: Field, raw: int) -> float:
    """In the field's unit."""
    return (raw - field.idle) * field.scale


def raw_of(field: Field, value: float, limit: float = math.inf) -> int:
    """The raw number nearest to `value`, idle for one that is not finite, and such that what it means is
    never beyond ±`limit`."""
    low, high = field.limits
    if not math.isfinite(value):
        return field.idle
    steps = round(min(max(value / field.scale, low - field.idle), high - field.idle))
    if abs(steps * field.scale) > limit:
        most = math.floor(limit / abs(field.scale))
        steps = int(math.copysign(most, steps))
    return field.idle + steps


def _mask(field: Field) -> int:
    return field.mask if field.mask is not None else (1 << (8 * TYPES[field.type][1] - field.shift)) - 1
