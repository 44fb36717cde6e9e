"""What a column's header says: its label and, where it states one, its unit."""

from __future__ import annotations

import re

from haptic_teleop_sysid.logs.units import Unit, unit_of

_BRACKETED = re.compile(r"^(.*?)\s*[\[({<]\s*([^\[\](){}<>]+?)\s*[\])}>]\s*$")
_SLASHED = re.compile(r"^(.+?)\s+(?:/|in)\s+(\S+)$")
_TRAILING = re.compile(r"^(.+?)[_ .:-]([A-Za-z°µ][A-Za-z°µ/*^0-9]*(?:_per_[a-z]+)?)$")
#: Endings that are names as often as units: q_m is a motor's angle, i_A may be a phase.
_AMBIGUOUS = frozenset(
    ("m", "n", "N", "A", "V", "h", "r", "U", "in", "inc", "1", "nm", "c", "u", "k", "M", "ft", "grad")
)


def split_header(text: str) -> tuple[str, str]:
    """Return (label, unit) of a header; unit "" where it states none that is known.

    A unit stands in brackets (`angle [deg]`, `torque (Nmm)`), behind a lone slash (`t / ms`) or at the end of
    the name (`angle_deg`, `speed_rad_per_s`); the last only where it cannot be a name.
    """
    text = " ".join(str(text).split()).strip("\"'")
    found = _BRACKETED.match(text)
    if found and found[1] and _unit_of(found[2]):
        return found[1].strip(), found[2]
    found = _SLASHED.match(text)
    if found and _unit_of(found[2]):
        return found[1].strip(), found[2]
    for pattern in (r"^(.+?)_((?:deg|rad|rev|mm|m)_per_s)$", r"^(.+?)_((?:deg|rad|rev|mm)_s)$"):
        found = re.match(pattern, text)
        if found:
            return found[1], found[2].replace("_per_", "/").replace("_s", "/s")
    found = _TRAILING.match(text)
    if found and found[2] not in _AMBIGUOUS and _unit_of(found[2]):
        if found[2] == "s" and not _tells_time(found[1]):
            return text, ""
        return found[1], found[2]
    return text, ""


def unknown_unit(text: str) -> str:
    """What stands where a unit stands in a header, in square brackets, or in others and made like one
    (`%`, `ft*lb`), and is none that is known; "" where nothing does. `q[1]` is the first of some."""
    text = " ".join(str(text).split()).strip("\"'")
    found = _BRACKETED.match(text)
    if not found or not found[1] or _unit_of(found[2]) or found[2].isdigit():
        return ""
    return found[2] if text.endswith("]") or re.search(r"[%*/^·]", found[2]) else ""


def words_of(label: str) -> tuple[str, ...]:
    """The words of a label in lower case, camelCase and digits apart: `q_m1`, `motorPos` -> motor, pos."""
    apart = re.sub(r"([a-z])([A-Z])", r"\1 \2", label)
    apart = re.sub(r"([A-Za-z])(\d)", r"\1 \2", apart)
    apart = re.sub(r"(\d)([A-Za-z])", r"\1 \2", apart)
    return tuple(w.lower() for w in re.split(r"[^A-Za-z0-9]+", apart) if w)


def _unit_of(text: str) -> Unit | None:
    """A unit that has a dimension: `q[1]` is the first of some, not one of dimension 1."""
    found = unit_of(text)
    return found if found and found.powers else None


def _tells_time(label: str) -> bool:
    return bool({"t", "time", "zeit", "timestamp", "stamp", "elapsed"} & set(words_of(label)))
