"""What a column may be, by its name and unit: time, input, or a position or velocity of motor or arm."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from haptic_teleop_sysid.logs.headers import words_of
from haptic_teleop_sysid.logs.log import Column
from haptic_teleop_sysid.logs.units import SHARE, unit_of


def _set(text: str) -> frozenset[str]:
    return frozenset(text.split())


_TIME = _set("t time zeit timestamp stamp elapsed seconds sec tid temps tiempo ms")
_POSITION = _set(
    "pos position positions angle angles q theta th winkel phi enc encoder rotation lage weg displacement "
    "deflection stellung alpha x qm qa ql"
)
_VELOCITY = _set(
    "vel velocity velocities speed spd vitesse velocidad dq qd qdot dtheta thetad thetadot omega drehzahl "
    "geschwindigkeit rpm v w dqm dqa dx xd"
)
_TORQUE = _set("torque torques tau moment drehmoment effort efforts trq")
_FORCE = _set("force kraft f fx")
_CURRENT = _set("current strom i iq amps amp")
_VOLTAGE = _set("voltage spannung u volts volt")
_DUTY = _set("pwm duty throttle")
_COMMAND = _set("cmd command ref reference des desired target setpoint soll goal demand set d")
_ACTUAL = _set("meas measured act actual ist fbk feedback real is")
_MOTOR = _set("motor mot drive rotor antrieb m servo qm dqm")
_ARM = _set("arm link load output last abtrieb tip l a qa ql dqa gelenk")
_NEITHER = _set(
    "err error errors acc accel acceleration accelerations ddq qdd ddx temp temperature status state mode "
    "flag count index idx id seq sample nr number row energy power"
)
_WORDS = {
    "input": (_TORQUE | _FORCE | _CURRENT | _VOLTAGE | _DUTY),
    "position": _POSITION,
    "velocity": _VELOCITY,
    "time": _TIME,
}
_QUANTITY_ROLE = {
    "time": "time",
    "torque": "input",
    "force": "input",
    "current": "input",
    "voltage": "input",
    SHARE: "input",
    "angle": "position",
    "length": "position",
    "count": "position",
    "angular velocity": "velocity",
    "velocity": "velocity",
    "count rate": "velocity",
}


@dataclass(frozen=True)
class Candidate:
    """A column as it may be taken: ``role`` ("time", "input", "position", "velocity"), ``part`` ("motor",
    "arm" or "" for not said), ``joint``: what its name says of which joint it is ("" for nothing),
    ``stated``: its unit says the role; ``command``: it names what was asked for, not what was measured;
    ``why``: what says its role, "" for its name; ``weak``: its name is letters of one character alone."""

    column: Column
    role: str
    part: str
    joint: str
    stated: bool
    command: bool
    measured: bool
    why: str = ""
    weak: bool = False


def candidate(column: Column) -> Candidate | None:
    """Return what a column may be, or None for nothing that a recording of joints holds."""
    joint, label = _joint_of(column)
    words = words_of(label)
    known = set(words) | {"".join(words)}
    if known & _NEITHER and not known & _WORDS["time"]:
        return None
    unit = unit_of(column.known)
    if unit is not None and unit.quantity == SHARE and not known & (_WORDS["input"] | _COMMAND):
        unit = None  # much else is in percent: a battery, the place of a valve
    stated = unit is not None
    role = _role_by_words(words) if unit is None else _QUANTITY_ROLE.get(unit.quantity, "")
    if not role:
        return None
    part = "motor" if known & _MOTOR else "arm" if known & _ARM else ""
    why = f"{role} in {column.usual} by REP 103; of a linear joint, give m, m/s, N" if column.usual else ""
    weak = not stated and all(len(w) == 1 or w.isdigit() for w in words)
    command, measured = bool(known & _COMMAND), bool(known & _ACTUAL)
    return Candidate(column, role, part, joint, stated, command, measured, why, weak)


def says_nothing(column: Column) -> bool:
    """Whether neither name nor unit of a column says what it is, or that it is none of a joint's signals."""
    words = words_of(_joint_of(column)[1])
    said = {*words, "".join(words)} & (_NEITHER | _COMMAND)
    return candidate(column) is None and not said and unit_of(column.known) is None


def counts_rows(column: Column) -> bool:
    """Whether a column counts rows by its name, or is text, and so tells no time."""
    return column.text is not None or bool(set(words_of(column.label)) & _NEITHER)


def _role_by_words(words: Sequence[str]) -> str:
    """The role that words suggest: whole words before single letters, the name as one word (iq) before its
    parts."""
    whole = {w for w in words if len(w) > 2}
    for known, order in (
        (whole, ("velocity", "input", "position", "time")),
        ({"".join(words)}, ("input", "velocity", "position", "time")),
        (set(words), ("time", "velocity", "position", "input")),
    ):
        for role in order:
            if known & _WORDS[role]:
                return role
    return ""


def input_unit_by_name(column: Column) -> str:
    """The unit that the words of an input's name suggest; "" where none does."""
    words = words_of(_joint_of(column)[1])
    known = {*words, "".join(words)}
    for words, unit in ((_TORQUE, "N*m"), (_FORCE, "N"), (_CURRENT, "A"), (_VOLTAGE, "V")):
        if known & words:
            return unit
    return ""


def joint_names(candidates: Sequence[Candidate]) -> list[str]:
    """The joints that states are named for, in order; one without a name where none is."""
    named = [c.joint for c in candidates if c.role in ("position", "velocity") and not c.command]
    return list(dict.fromkeys(named))


def _joint_of(column: Column) -> tuple[str, str]:
    """(joint, the rest of the label): from `field[elbow]`, else from the number in the name."""
    label = column.label
    topic, _, path = label.rpartition(":") if label.startswith("/") else ("", "", label)
    found = re.match(r"^(.*)\[([^\]]+)\](.*)$", path)
    if found:
        inner = found[2]
        return (inner if not inner.isdigit() else f"j{inner}"), f"{found[1]} {found[3]}".strip()
    digits = re.findall(r"\d+", path)
    if len(digits) == 1:
        return f"j{int(digits[0])}", re.sub(r"\d+", " ", path)
    return "", path
