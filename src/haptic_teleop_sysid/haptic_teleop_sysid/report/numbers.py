"""Numbers and units as every page writes them: 0.412 ± 0.010 N·m."""

from __future__ import annotations

import math
import re

#: Digits of a number, however small its error.
MOST_DIGITS = 10
_EXPONENT = {"2": "²", "3": "³"}
#: A hyphen that stands for a minus: before a number, and behind no word, path or number.
_MINUS = re.compile(r"(?<![\w./\\-])-(?=\.?\d)")
_UNIT = re.compile(
    r"(?<![\w·])(?:N|kg|rad|m|s|A|V)(?:[*·](?:m|s|rad)(?:\^[23])?|/(?:rad|A|V|s|m)(?:\^[23])?)+(?![\w*/])"
)


def unit_text(unit: str) -> str:
    """A unit as a reader writes it: N*m*s/rad -> N·m·s/rad, kg*m^2 -> kg·m²; none for a plain number."""
    if unit == "1":
        return ""
    return re.sub(r"\^([23])", lambda m: _EXPONENT[m[1]], unit.replace("*", "·"))


def units_in(text: str) -> str:
    """A sentence with its units, wherever they stand, written that way, and a minus before its numbers."""
    return _MINUS.sub("−", _UNIT.sub(lambda m: unit_text(m[0]), text))


def rounded(value: float, std: float | None) -> str:
    """A number to the digit at which its standard error has its second; to four digits without one."""
    if std is None or not (math.isfinite(std) and std > 0.0 and math.isfinite(value)):
        return f"{value:.4g}"
    digits = 1 - math.floor(math.log10(std))
    most = MOST_DIGITS if abs(value) >= 1e-3 else 7
    if digits - 1 >= -3 and abs(value) < 1e6 and digits <= most:
        return f"{round(value, digits) + 0.0:.{max(digits, 0)}f}"
    known = digits + (math.floor(math.log10(abs(value))) + 1 if value else 0)
    return f"{value:.{min(max(known, 4), MOST_DIGITS)}g}"


def error_text(std: float) -> str:
    """A standard error to two digits, without an exponent where that can be read."""
    digits = 1 - math.floor(math.log10(std)) if std > 0.0 and math.isfinite(std) else 0
    return f"{std:.{max(digits, 0)}f}" if std > 0.0 and -3 <= digits <= 7 else f"{std:.2g}"


def relative(value: float, std: float | None) -> tuple[str, str] | None:
    """A number that is known relative to another one only, and its standard error: "0.1700", "< 0.0001".
    No digit beyond the fourth means anything there; None where the error reaches that digit by itself."""
    if not value or std is None or not (math.isfinite(std) and math.isfinite(value)):
        return None
    place = math.floor(math.log10(abs(value))) - 3
    if std >= 10.0**place:
        return None
    if -8 <= place <= 0:
        return f"{value:.{-place}f}", f"< {10.0**place:.{-place}f}"
    return f"{value:.3e}", f"< {10.0**place:.0e}"


def with_error(value: float, std: float | None, unit: str = "", relative_to: str | None = None) -> str:
    """A number with its standard error, where it has one, and its unit: "0.412 ± 0.010 N·m"; of one that is
    known ``relative_to`` another only, as many digits as mean anything."""
    if relative_to and (few := relative(value, std)) is not None:
        return f"{few[0]} {unit_text(unit)}".rstrip() + f" (relative to the {relative_to.replace('_', ' ')})"
    told = rounded(value, std)
    if std is not None and math.isfinite(std) and std > 0.0:
        told += f" ± {error_text(std)}"
    return f"{told} {unit_text(unit)}".rstrip()
