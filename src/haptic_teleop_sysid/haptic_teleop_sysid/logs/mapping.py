"""The mapping file: which column of a log is time, input, motor and arm, in which unit, with which sign."""

from __future__ import annotations

import math
from collections.abc import Mapping as MappingType
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.named_files import why_unreadable
from haptic_teleop_control.strict_yaml import parse_yaml, yaml_problem
from haptic_teleop_sysid.logs.dialect import Stated
from haptic_teleop_sysid.logs.units import SHARE, Unit, unit_of

VERSION = 1
QUANTITIES = {
    "input": ("torque", "force", "current", "voltage", SHARE),
    "position": ("angle", "length"),
    "velocity": ("angular velocity", "velocity"),
}
_DELIMITERS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": " ", "bar": "|"}


@dataclass(frozen=True)
class Entry:
    """One signal: ``column`` (name, or number from 1), ``unit`` of what stands there ("": what the file
    states), ``sign``, ``gain`` in ``gain_unit`` by which it is multiplied, ``counts_per_turn``."""

    column: str | int
    unit: str = ""
    sign: int = 1
    gain: float = 1.0
    gain_unit: str = ""
    counts_per_turn: float | None = None
    unwrap: bool = False

    def plain(self) -> dict[str, Any]:
        """The entry as the mapping file has it, without what is as if not said."""
        default = Entry(self.column)
        return {n: v for n, v in self.__dict__.items() if n == "column" or v != getattr(default, n)}


@dataclass(frozen=True)
class Mapping:
    """``time``: its column and unit, or None where the log's own stamps or ``rate`` (Hz) say when;
    ``joints``: name -> signal (`input`, `motor_position`, `motor_velocity`, `arm_position`, `arm_velocity`)
    -> Entry; ``stated``: how a text table is written; ``source``: where the mapping is from; ``notes``: what
    to tell beside it."""

    joints: dict[str, dict[str, Entry]]
    time: Entry | None = None
    rate: float | None = None
    stated: Stated | None = None
    source: str = "mapping"
    notes: tuple[str, ...] = field(default=())

    def plain(self) -> dict[str, Any]:
        """The mapping as plain data, as the file would have it."""
        content: dict[str, Any] = {"haptic_teleop_import": VERSION}
        if self.rate is not None:
            content["time"] = {"rate": self.rate}
        elif self.time is not None:
            content["time"] = self.time.plain()
        content["joints"] = {
            joint: _nested({signal: entry.plain() for signal, entry in signals.items()})
            for joint, signals in self.joints.items()
        }
        return content

    def entries(self) -> list[Entry]:
        """Every entry."""
        return [e for signals in self.joints.values() for e in signals.values()]

    def topics(self) -> tuple[str, ...]:
        """The topics of a bag that the columns name."""
        names = [
            e.column
            for e in (*self.entries(), *([self.time] if self.time else []))
            if isinstance(e.column, str)
        ]
        return tuple(dict.fromkeys(n.partition(":")[0] for n in names if n.startswith("/")))


def _nested(signals: dict[str, Any]) -> dict[str, Any]:
    content: dict[str, Any] = {}
    for signal, entry in signals.items():
        part, _, kind = signal.partition("_")
        if kind:
            content.setdefault(part, {})[kind] = entry
        else:
            content[part] = entry
    return content


def load_mapping(path: str | Path) -> Mapping:
    """Read a mapping file. Raises ConfigurationError, naming key and remedy, for what it may not say."""
    source = str(path)
    try:
        content = parse_yaml(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        why = why_unreadable(path, error)
        raise ConfigurationError(f"{source}: the mapping cannot be read: {why}") from error
    except yaml.YAMLError as error:
        raise ConfigurationError(f"{source}: {yaml_problem(error)}") from error
    return mapping_from(content, source)


def mapping_from(content: Any, source: str) -> Mapping:
    """The mapping that plain data describe; errors as of `load_mapping`."""
    top = _section(content, source, "the file", ("haptic_teleop_import", "time", "joints", "read"))
    if top.get("haptic_teleop_import") != VERSION:
        raise ConfigurationError(
            f"{source}: begin it with `haptic_teleop_import: {VERSION}`, as `import LOG --suggest` does."
        )
    time, rate = _time(top.get("time"), source)
    joints = _section(top.get("joints"), source, "joints", None)
    if not joints:
        raise ConfigurationError(f"{source}: joints names no joint: name one, with its columns.")
    return Mapping(
        {str(n): _signals(j, source, f"joints.{n}") for n, j in joints.items()},
        time,
        rate,
        _stated(top.get("read"), source),
        source,
    )


def _time(content: Any, source: str) -> tuple[Entry | None, float | None]:
    if content is None:
        return None, None
    if isinstance(content, MappingType) and "rate" in content:
        _section(content, source, "time", ("rate",))
        rate = _number(content["rate"], source, "time.rate")
        if not 0.0 < rate <= 1e6:
            raise ConfigurationError(f"{source}: time.rate is {rate:g}: give the sampling rate in Hz.")
        return None, rate
    entry = _entry(content, source, "time")
    if entry.unit and _known(entry.unit, source, "time").quantity != "time":
        raise ConfigurationError(
            f"{source}: time.unit {entry.unit!r} is no unit of time: give s, ms, us or ns."
        )
    return entry, None


def _signals(content: Any, source: str, where: str) -> dict[str, Entry]:
    joint = _section(content, source, where, ("input", "motor", "arm"))
    found: dict[str, Entry] = {}
    if joint.get("input") is not None:
        found["input"] = _entry(joint["input"], source, f"{where}.input")
    for part in ("motor", "arm"):
        if joint.get(part) is None:
            continue
        kinds = _section(joint[part], source, f"{where}.{part}", ("position", "velocity"))
        for kind, entry in kinds.items():
            found[f"{part}_{kind}"] = _entry(entry, source, f"{where}.{part}.{kind}")
    if not any(signal.startswith("motor") for signal in found):
        raise ConfigurationError(
            f"{source}: {where} has no motor.position and no motor.velocity: name the column of one."
        )
    return found


def _entry(content: Any, source: str, where: str) -> Entry:
    if isinstance(content, (str, int)) and not isinstance(content, bool):
        content = {"column": content}
    allowed = ("column", "unit", "sign", "gain", "gain_unit", "counts_per_turn", "unwrap")
    given = _section(content, source, where, allowed)
    column = given.get("column")
    if not isinstance(column, (str, int)) or isinstance(column, bool) or column == "":
        raise ConfigurationError(
            f"{source}: {where} names no column: give column: NAME, or its number from 1."
        )
    entry = Entry(
        column,
        str(given.get("unit") or ""),
        int(_number(given.get("sign", 1), source, f"{where}.sign")),
        _number(given.get("gain", 1.0), source, f"{where}.gain"),
        str(given.get("gain_unit") or ""),
        None
        if given.get("counts_per_turn") is None
        else _number(given["counts_per_turn"], source, f"{where}.counts_per_turn"),
        given.get("unwrap", False) is True,
    )
    if given.get("unwrap", False) not in (True, False):
        raise ConfigurationError(f"{source}: {where}.unwrap is {given['unwrap']!r}: give true or false.")
    if given.get("sign", 1) not in (1, -1):
        raise ConfigurationError(f"{source}: {where}.sign is {given['sign']}: give 1 or -1.")
    for value, what in ((entry.gain, "gain"), (entry.counts_per_turn, "counts_per_turn")):
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise ConfigurationError(f"{source}: {where}.{what} must be above zero: put the sign into sign.")
    for text, what in ((entry.unit, "unit"), (entry.gain_unit, "gain_unit")):
        if text:
            _known(text, source, f"{where}.{what}")
    return entry


def _known(text: str, source: str, where: str) -> Unit:
    found = unit_of(text)
    if found is None:
        raise ConfigurationError(
            f"{source}: {where}: {text!r} is no unit that is known: write it like deg, rad/s, rpm, mm, N*mm, "
            "mA, V, %, counts or N*m/V."
        )
    return found


def _section(content: Any, source: str, where: str, allowed: tuple[str, ...] | None) -> MappingType[str, Any]:
    if not isinstance(content, MappingType):
        raise ConfigurationError(f"{source}: {where} is no mapping of keys to values: see `import --help`.")
    for key in content:
        if allowed is not None and key not in allowed:
            raise ConfigurationError(
                f"{source}: {where} has an unknown key {key!r}: it may have {', '.join(allowed)}."
            )
    return content


def _number(value: Any, source: str, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ConfigurationError(f"{source}: {where} is {value!r}: give a finite number.")
    return float(value)


def _stated(content: Any, source: str) -> Stated | None:
    if content is None:
        return None
    given = _section(content, source, "read", ("delimiter", "decimal", "header", "skip"))
    delimiter = given.get("delimiter")
    delimiter = _DELIMITERS.get(str(delimiter), delimiter)
    if delimiter is not None and (not isinstance(delimiter, str) or len(delimiter) != 1):
        raise ConfigurationError(f"{source}: read.delimiter: give one of {', '.join(_DELIMITERS)}.")
    decimal = {"comma": ",", "point": "."}.get(str(given.get("decimal")), given.get("decimal"))
    if decimal not in (None, ".", ","):
        raise ConfigurationError(f"{source}: read.decimal: give point or comma.")
    header = given.get("header")
    if header not in (None, True, False):
        raise ConfigurationError(f"{source}: read.header: give true or false.")
    return Stated(delimiter, decimal, header, int(_number(given.get("skip", 0), source, "read.skip")))
