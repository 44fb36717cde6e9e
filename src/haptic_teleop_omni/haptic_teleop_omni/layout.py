"""The layout of a device's reports as data: a YAML file says where each value lies, code only follows it.

    value = raw x scale            of inputs, raw = ((word >> shift) & mask), inverted where so stated
    word  = value / scale + idle   of outputs, between minimum and maximum

A file cannot say that it fits a real device: who has seen that says so with the driver's parameter
`layout_confirmed_for`, in words that name the device and these very reports (`ReportLayout.confirmation`).
"""

from __future__ import annotations

import hashlib
import importlib.resources
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import yaml

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.strict_yaml import parse_yaml, yaml_problem
from haptic_teleop_omni.checksums import CHECKSUMS

TYPES = {
    "u8": ("B", 1),
    "i8": ("b", 1),
    "u16": ("<H", 2),
    "i16": ("<h", 2),
    "u32": ("<I", 4),
    "i32": ("<i", 4),
}
REQUIRED_INPUT = ("encoder_x", "encoder_y", "encoder_z")
REQUIRED_OUTPUT = ("torque_x", "torque_y", "torque_z", "motors_on")
OPTIONAL_INPUT = (
    "gimbal_x", "gimbal_y", "gimbal_z", "button_1", "button_2", "docked", "counter",
    "calibrated", "error", "internal_error", "temperature",
)  # fmt: skip
OPTIONAL_OUTPUT = ("dock_light",)


@dataclass(frozen=True)
class Field:
    """One value in a report; see the module for the formulas. offset: byte. type: of TYPES, little-endian."""

    name: str
    offset: int
    type: str
    shift: int = 0
    mask: int | None = None
    invert: bool = False
    scale: float = 1.0
    unit: str = ""
    idle: int = 0
    minimum: int | None = None
    maximum: int | None = None

    @property
    def bits(self) -> int:
        """Width of the raw value."""
        return self.mask.bit_length() if self.mask is not None else 8 * TYPES[self.type][1] - self.shift

    @property
    def limits(self) -> tuple[int, int]:
        """Smallest and largest raw value of an output."""
        signed = self.type.startswith("i")
        span = 1 << self.bits
        low, high = (-span // 2, span // 2 - 1) if signed and self.mask is None else (0, span - 1)
        return (low if self.minimum is None else self.minimum, high if self.maximum is None else self.maximum)


@dataclass(frozen=True)
class Report:
    """One direction. length: bytes, the report number included where there is one (`report_id`).
    constants: (byte, value) pairs that are always there. absolute: the encoders need no calibration pose,
    because `calibrated` tells when they are those of the device."""

    length: int
    report_id: int | None
    checksum: str
    fields: Mapping[str, Field]
    constants: tuple[tuple[int, int], ...] = ()
    absolute: bool = False


@dataclass(frozen=True)
class ReportLayout:
    """Both directions of one device."""

    name: str
    input: Report
    output: Report
    source: str

    def confirmation(self, device: str) -> str:
        """What somebody has to type who has seen this layout agree with `device`; another after any change to
        the reports."""
        reports = [(r.length, r.report_id, r.checksum, sorted(r.fields.items()), r.constants,
                    *([True] if r.absolute else []))
                   for r in (self.input, self.output)]  # fmt: skip
        digest = hashlib.sha256(repr(reports).encode()).hexdigest()[:8]
        return f"{device} {self.name} {digest}"


def load_layout(name: str) -> ReportLayout:
    """A layout of this package by its name (`emulator`, `touch_hid`), or from a YAML file.

    Raises ConfigurationError naming file, key and remedy.
    """
    folder = importlib.resources.files("haptic_teleop_omni") / "layouts"
    packaged = folder / f"{name}.yaml"
    path = Path(name)
    try:
        text = packaged.read_text("utf-8") if packaged.is_file() else path.read_text("utf-8")
        content = parse_yaml(text)
    except OSError as refusal:
        known = sorted(entry.name[:-5] for entry in folder.iterdir() if entry.name.endswith(".yaml"))
        raise ConfigurationError(
            f"layout is {name!r}, which cannot be read ({refusal.strerror}); name a file, or one of "
            f"{', '.join(known)}."
        ) from refusal
    except yaml.YAMLError as problem:
        raise ConfigurationError(f"{name}: {yaml_problem(problem)}") from None
    except UnicodeDecodeError as problem:
        raise ConfigurationError(f"{name}: is no text ({problem}); name another file.") from problem
    return parse_layout(content, name)


def parse_layout(content: Any, source: str) -> ReportLayout:
    """The layout that a YAML file's content describes. Raises ConfigurationError as `load_layout`."""
    if isinstance(content, Mapping) and "verified" in content:
        raise ConfigurationError(
            f"{source}: verified is no longer looked at; delete it, and confirm the layout for your own "
            "device with the parameter layout_confirmed_for, which the driver's first line spells out."
        )
    top = _mapping(content, source, "the file", ("name", "input", "output"))
    directions = {}
    for direction, required, optional in (
        ("input", REQUIRED_INPUT, OPTIONAL_INPUT),
        ("output", REQUIRED_OUTPUT, OPTIONAL_OUTPUT),
    ):
        if direction not in top:
            raise ConfigurationError(f"{source}: {direction} is missing; describe the report's fields.")
        directions[direction] = _report(top[direction], f"{source}: {direction}", required, optional)
    return ReportLayout(str(top.get("name", source)), directions["input"], directions["output"], source)


def _report(content: Any, where: str, required: tuple[str, ...], optional: tuple[str, ...]) -> Report:
    entries = _mapping(
        content, where, "the report", ("length", "report_id", "checksum", "fields", "constants", "absolute")
    )
    length = _whole(entries.get("length"), f"{where}: length", 1, 4096)
    report_id = entries.get("report_id")
    if report_id is not None:
        report_id = _whole(report_id, f"{where}: report_id", 0, 255)
    checksum = entries.get("checksum", "none")
    if checksum not in CHECKSUMS:
        raise ConfigurationError(f"{where}: checksum is {checksum!r}; choose {' | '.join(CHECKSUMS)}.")
    stated = _mapping(entries.get("fields"), f"{where}: fields", "the fields", (*required, *optional))
    missing = [name for name in required if name not in stated]
    if missing:
        raise ConfigurationError(f"{where}: fields lacks {missing[0]}; add its offset and type.")
    fields = {name: _field(name, entry, f"{where}: {name}", length) for name, entry in stated.items()}
    constants = []
    for offset, values in _mapping(entries.get("constants", {}), f"{where}: constants", "it", None).items():
        first = _whole(offset, f"{where}: constants", 0, length - 1)
        for i, value in enumerate(values if isinstance(values, list) else [values]):
            _whole(first + i, f"{where}: constants", 0, length - 1)
            constants.append((first + i, _whole(value, f"{where}: constants: {offset}", 0, 255)))
    absolute = entries.get("absolute", False)
    if not isinstance(absolute, bool) or (absolute and "calibrated" not in fields):
        raise ConfigurationError(
            f"{where}: absolute is {absolute!r}; write true with a field calibrated, or false."
        )
    return Report(length, report_id, checksum, fields, tuple(constants), absolute)


def _field(name: str, content: Any, where: str, length: int) -> Field:
    known = ("offset", "type", "shift", "mask", "invert", "scale", "unit", "idle", "minimum", "maximum")
    entry = _mapping(content, where, "the field", known)
    kind = entry.get("type")
    if kind not in TYPES:
        raise ConfigurationError(f"{where}: type is {kind!r}; choose {' | '.join(TYPES)}.")
    size = TYPES[kind][1]
    offset = _whole(entry.get("offset"), f"{where}: offset", 0, length - size)
    scale = entry.get("scale", 1.0)
    if (
        isinstance(scale, bool)
        or not isinstance(scale, int | float)
        or not math.isfinite(scale)
        or scale == 0
    ):
        raise ConfigurationError(f"{where}: scale is {scale!r}; write a finite number other than 0.")
    invert = entry.get("invert", False)
    if not isinstance(invert, bool):
        raise ConfigurationError(f"{where}: invert is {invert!r}; write true or false.")
    full = 1 << (8 * size)
    limits = {
        key: _whole(entry[key], f"{where}: {key}", -full // 2, full - 1)
        for key in ("idle", "minimum", "maximum")
        if key in entry
    }
    mask = entry.get("mask")
    found = Field(
        name=name,
        offset=offset,
        type=kind,
        shift=_whole(entry.get("shift", 0), f"{where}: shift", 0, 8 * size - 1),
        mask=None if mask is None else _whole(mask, f"{where}: mask", 1, full - 1),
        invert=invert,
        scale=float(scale),
        unit=str(entry.get("unit", "")),
        **limits,
    )
    if (found.mask or 0) << found.shift >= full:
        raise ConfigurationError(
            f"{where}: mask {found.mask:#x} shifted by {found.shift} is wider than {kind}; narrow it."
        )
    natural = replace(found, minimum=None, maximum=None).limits
    low, high = found.limits
    if not natural[0] <= low <= high <= natural[1]:
        raise ConfigurationError(
            f"{where}: minimum {low} and maximum {high} do not fit; choose from {natural[0]} to {natural[1]}."
        )
    if not low <= found.idle <= high:
        raise ConfigurationError(f"{where}: idle is {found.idle}; choose {low} to {high}.")
    return found


def _mapping(content: Any, where: str, what: str, known: tuple[str, ...] | None) -> Mapping[Any, Any]:
    if not isinstance(content, Mapping):
        raise ConfigurationError(f"{where}: {what} must be `key: value` lines; see layouts/emulator.yaml.")
    for key in content:
        if known is not None and key not in known:
            raise ConfigurationError(f"{where}: {key} is unknown; known are {', '.join(known)}.")
    return content


def _whole(value: Any, where: str, low: int, high: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise ConfigurationError(f"{where} is {value!r}; write a whole number from {low} to {high}.")
    return value
