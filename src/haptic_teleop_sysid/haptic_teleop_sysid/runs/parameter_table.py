"""The estimated parameters in rows: value, standard error, interval, and what may not be said."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from haptic_teleop_sysid.estimation.result import Estimate
from haptic_teleop_sysid.recordings.parameter_units import Units
from haptic_teleop_sysid.recordings.relative_scale import relative_to
from haptic_teleop_sysid.report import error_text, relative, rounded, unit_text

MOSTLY = 0.5
"""Share of a standard error from which it is said that other forms of a law make it."""
ESTIMATED, NEAR_ZERO = "estimated", "not distinguishable from zero"
NUMBERS = (ESTIMATED, NEAR_ZERO)
"""What rows say that hold an estimate."""


@dataclass(frozen=True)
class Row:
    """`value` is None where the data do not determine it, `std` and `interval` where there is nothing to say.
    status: "estimated", "fixed", "not determined", "not distinguishable from zero" or "not to be used";
    `note` in words. `at_least`: the true error is larger than `std`, and unknown, because the estimate is in
    doubt; `relative_to`: the fixed parameter whose error comes on top, one to one, "" for none."""

    name: str
    unit: str
    start: float
    value: float | None
    std: float | None
    interval: tuple[float, float] | None
    status: str
    note: str = ""
    at_least: bool = False
    relative_to: str = ""


def parameter_rows(found: Estimate, units: Units | None = None, doubted: bool = False) -> list[Row]:
    """All parameters of the model in its order, the estimated and the fixed ones; ``units`` of a machine that
    is not turned by N·m; ``doubted``: something speaks against them, so that no standard error holds."""
    rows = [_row(found, name, units or Units()) for name in found.model.parameter_values()]
    rows = [
        replace(row, relative_to=relative_to(found.model, row.name)) if row.status in NUMBERS else row
        for row in rows
    ]
    if not doubted:
        return rows
    return [row if row.std is None else replace(row, at_least=True, interval=None) for row in rows]


def _row(found: Estimate, name: str, units: Units) -> Row:
    unsure, value = found.uncertainty, found.model.parameter_values()[name]
    start = found.start.parameter_values()[name]
    unit = units.of_parameter(found.model, name)
    if name not in found.model.free_parameters():
        return Row(name, unit, start, value, None, None, "fixed")
    if (why := found.contradictions.get(name.rpartition(".")[0])) is not None:
        return Row(name, unit, start, value, None, None, "not to be used", f"not to be used: {why}")
    if unsure is None:
        std = found.plain_std.get(name, math.nan)
        known = math.isfinite(std)
        note = f"{found.method} knows no noise" + ("" if known else " and gives no standard error")
        return Row(name, unit, start, value, std if known else None, None, ESTIMATED, note)
    if name in unsure.undetermined:
        return Row(name, unit, start, None, None, None, "not determined", unsure.undetermined[name])
    std = float(unsure.std[unsure.names.index(name)])
    zero = name in unsure.near_zero
    note = _note(zero, found.by_form.get(name, 0.0) > MOSTLY * std)
    status = NEAR_ZERO if zero else ESTIMATED
    return Row(name, unit, start, value, std, unsure.interval(name, value), status, note)


def _note(zero: bool, by_form: bool) -> str:
    said = ["it may as well be zero"] if zero else []
    said += ["the error covers other published forms of this law"] if by_form else []
    return "; ".join(said)


def as_text(row: Row) -> list[str]:
    """The row's cells for a table: name, unit, start, value, standard error, interval, remark."""
    few = relative(row.value, row.std) if row.relative_to and row.value is not None else None
    interval = "–"
    if row.value is None:
        value, std = "not determined", "–"
    elif row.std is None:
        value, std = f"{row.value:.6g}", "–"
    elif few is not None:
        value, std = few[0], "–" if row.at_least else few[1]
    else:
        value, std = rounded(row.value, row.std), error_text(row.std)
        std = f"at least {std}" if row.at_least else std
        if row.interval is not None:
            interval = " … ".join(rounded(end, row.std) for end in row.interval)
    return [row.name, unit_text(row.unit), f"{row.start:.6g}", value, std, interval, remark(row)]


def remark(row: Row, in_full: bool = True) -> str:
    """What is said beside a row: its note, or in short its status, and what its error leaves out."""
    said = [row.note] if row.note and in_full else []
    if not said and not (row.relative_to and row.status == ESTIMATED):
        said.append(row.status)
    if row.relative_to:
        said.append(f"relative to the {row.relative_to.replace('_', ' ')}")
    if row.at_least and in_full:
        said.append("the error is larger")
    return "; ".join(said)


def caption(doubted: bool) -> str:
    """What stands above the table."""
    if doubted:
        return (
            "Estimates that are in doubt, as said above: their errors are larger than the standard errors, "
            "by nobody knows how much, and no interval is given"
        )
    return "Estimates with their standard errors and intervals of 95 %"


HEADER = ["parameter", "unit", "start", "estimate", "std. error", "95 % interval", "remark"]
