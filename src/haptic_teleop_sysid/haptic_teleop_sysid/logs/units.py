"""Units as people write them into headers: `Nmm`, `deg/s`, `1/min`, `°`, `mA`.

A name is a prefix and a unit, a unit text a product of names with small whole powers. Nothing else is
understood, so that no text from a file is ever evaluated.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from dataclasses import dataclass
from functools import cache

SHARE = "share of full drive"
"""What a duty cycle, a throttle or a torque in percent of the rated one is."""
_PREFIXES = {"": 1.0, "n": 1e-9, "u": 1e-6, "m": 1e-3, "c": 1e-2, "k": 1e3, "M": 1e6}
_TURN = 2.0 * math.pi

#: Symbols that take a prefix, and words and symbols that take none: (SI factor, powers of the base units).
_PREFIXED: dict[str, tuple[float, dict[str, int]]] = {
    "s": (1.0, {"s": 1}),
    "m": (1.0, {"m": 1}),
    "N": (1.0, {"N": 1}),
    "Nm": (1.0, {"N": 1, "m": 1}),
    "A": (1.0, {"A": 1}),
    "V": (1.0, {"V": 1}),
    "rad": (1.0, {"rad": 1}),
    "deg": (_TURN / 360.0, {"rad": 1}),
}
_WHOLE: dict[str, tuple[float, dict[str, int]]] = {
    "1": (1.0, {}),
    "min": (60.0, {"s": 1}),
    "h": (3600.0, {"s": 1}),
    "in": (0.0254, {"m": 1}),
    "rev": (_TURN, {"rad": 1}),
    "gon": (_TURN / 400.0, {"rad": 1}),
    "rpm": (_TURN / 60.0, {"rad": 1, "s": -1}),
    "rps": (_TURN, {"rad": 1, "s": -1}),
    "dps": (_TURN / 360.0, {"rad": 1, "s": -1}),
    "Nmm": (1e-3, {"N": 1, "m": 1}),
    "Ncm": (1e-2, {"N": 1, "m": 1}),
    "kgf": (9.80665, {"N": 1}),
    "ft": (0.3048, {"m": 1}),
    "lbf": (4.4482216152605, {"N": 1}),
    "ozf": (0.27801385095378, {"N": 1}),
    "count": (1.0, {"count": 1}),
    "pu": (1.0, {"pu": 1}),  # per unit of the full drive: duty cycle of a PWM, throttle
    "percent": (0.01, {"pu": 1}),
}
_SPELLINGS = {
    **dict.fromkeys(("sec", "secs", "second", "seconds", "sek"), "s"),
    **dict.fromkeys(("msec", "millisecond", "milliseconds"), "ms"),
    **dict.fromkeys(("usec", "microsecond", "microseconds"), "us"),
    **dict.fromkeys(("nsec", "nanosecond", "nanoseconds"), "ns"),
    **dict.fromkeys(("minute", "minutes"), "min"),
    **dict.fromkeys(("metre", "meter", "metres", "meters"), "m"),
    **dict.fromkeys(("inch", "inches"), "in"),
    **dict.fromkeys(("radian", "radians", "rads"), "rad"),
    **dict.fromkeys(("degree", "degrees", "Deg", "DEG", "degs"), "deg"),
    **dict.fromkeys(("turn", "turns", "revs", "revolution", "revolutions", "U", "r"), "rev"),
    "grad": "gon",
    **dict.fromkeys(("RPM", "Rpm"), "rpm"),
    **dict.fromkeys(("newton", "newtons", "Newton"), "N"),
    **dict.fromkeys(("NM", "Nm"), "Nm"),
    **dict.fromkeys(("amp", "amps", "ampere", "amperes", "Ampere"), "A"),
    **dict.fromkeys(("volt", "volts", "Volt"), "V"),
    **dict.fromkeys(
        ("counts", "cnt", "cnts", "cts", "tick", "ticks", "inc", "incs", "pulse", "pulses"), "count"
    ),
    **dict.fromkeys(("lb", "lbs"), "lbf"),
    "pct": "percent",
    "oz": "ozf",
}
_QUANTITIES = {
    (("s", 1),): "time",
    (("rad", 1),): "angle",
    (("rad", 1), ("s", -1)): "angular velocity",
    (("m", 1),): "length",
    (("m", 1), ("s", -1)): "velocity",
    (("N", 1), ("m", 1)): "torque",
    (("N", 1),): "force",
    (("A", 1),): "current",
    (("V", 1),): "voltage",
    (("pu", 1),): SHARE,
    (("count", 1),): "count",
    (("count", 1), ("s", -1)): "count rate",
    (("rad", 1), ("s", -2)): "angular acceleration",
    (("m", 1), ("s", -2)): "acceleration",
}
SI = {
    "time": "s",
    "angle": "rad",
    "angular velocity": "rad/s",
    "length": "m",
    "velocity": "m/s",
    "torque": "N*m",
    "force": "N",
    "current": "A",
    "voltage": "V",
    SHARE: "pu",
}
"""The unit in which a recording holds each quantity that it can hold."""
_CLEAN = str.maketrans(
    dict.fromkeys("·⋅×∙", "*")
    | dict.fromkeys("µμ", "u")
    | {"²": "^2", "⁻": "^-", "¹": "1", "−": "-", "%": "percent"}
)
_FACTOR = re.compile(r"([A-Za-z]+|1)(?:(?:\^|\*\*)?(-?[1-3]))?$")


@dataclass(frozen=True)
class Unit:
    """A unit: ``text`` as written, ``factor`` to SI, ``powers`` of the base units, ``quantity`` ("" for one
    that no column of a recording has)."""

    text: str
    factor: float
    powers: tuple[tuple[str, int], ...]

    @property
    def quantity(self) -> str:
        """What it measures, such as "torque"; "" where it is none that is known here."""
        return _QUANTITIES.get(self.powers, "")

    def __mul__(self, other: Unit) -> Unit:
        powers = Counter(dict(self.powers))
        for name, power in other.powers:
            powers[name] += power
        kept = tuple(sorted((n, p) for n, p in powers.items() if p))
        return Unit(f"{self.text}*({other.text})", self.factor * other.factor, kept)


@cache
def unit_of(text: str) -> Unit | None:
    """Return the unit that `text` names, or None. 1/min and 1/s alone are turns per time nowhere but for
    ``1/min`` and ``min^-1``, as drives state their speed."""
    cleaned = text.strip().translate(_CLEAN).replace("°", "deg")
    if not cleaned or len(cleaned) > 30:
        return None
    compact = re.sub(r"\s*([*/^])\s*", r"\1", cleaned).replace("(", "").replace(")", "")
    if compact in ("1/min", "min^-1", "min-1", "/min"):
        compact = "rpm"
    factor, powers, sign, complete = 1.0, Counter[str](), 1, False
    for part in re.split(r"(/|(?<!\*)\*(?!\*)|\s+|\.)", compact):
        if part in ("/",):
            complete = False
            sign = -1  # what stands behind a slash is below it: N*m/rad, deg/s
            continue
        if part.strip() in ("", "*", "."):
            continue
        found = _FACTOR.match(part)
        known = None if found is None else _named(found[1])
        if found is None or known is None:
            return None
        complete = True
        power = sign * int(found[2] or 1)
        factor *= known[0] ** power
        for name, own in known[1].items():
            powers[name] += own * power
    if not complete:
        return None
    return Unit(text.strip(), factor, tuple(sorted((n, p) for n, p in powers.items() if p)))


def _named(name: str) -> tuple[float, dict[str, int]] | None:
    name = _SPELLINGS.get(name, name)
    if name == "nm":  # newton metres or nanometres: nobody can tell
        return None
    if name in _WHOLE:
        return _WHOLE[name]
    for prefix, scale in _PREFIXES.items():
        rest = name[len(prefix) :]
        if name.startswith(prefix) and rest in _PREFIXED:
            factor, powers = _PREFIXED[rest]
            return scale * factor, powers
    return None
