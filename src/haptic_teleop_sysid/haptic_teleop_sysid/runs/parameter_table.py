"""The estimated parameters in rows: value, standard error, interval, and what may not be said."""

from __future__ import annotations

import math
from dataclasses import dataclass

from haptic_teleop_sysid.estimation.result import Estimate
from haptic_teleop_sysid.recordings.parameter_units import Units
from haptic_teleop_sysid.report import error_text, rounded, unit_text

MOSTLY = 0.5
"""Share of a standard error from which it is said that other forms of a law make it."""


@dataclass(frozen=True)
class Row:
    """`value` is None where the data do not determine it, `std` and `interval` where there is nothing to say.
    status: "estimated", "fixed", "not determined", "not distinguishable from zero" or "not to be used";
    `note` in words."""

    name: str
    unit: str
    start: float
    value: float | None
    std: float | None
    interval: tuple[float, float] | None
    status: str
    note: str = ""


def parameter_rows(found: Estimate, units: Units | None = None) -> list[Row]:
    """All parameters of the model in its order, the estimated and the fixed ones; ``units`` of a machine that
    is not turned by N·m."""
    units = units or Units()
    values, start = found.model.parameter_values(), found.start.parameter_values()
    free, unsure = found.model.free_parameters(), found.uncertainty
    rows = []
    for name, value in values.items():
        unit = units.of_parameter(found.model, name)
        if name not in free:
            rows.append(Row(name, unit, start[name], value, None, None, "fixed"))
        elif (why := found.contradictions.get(name.rpartition(".")[0])) is not None:
            note = f"not to be used: {why}"
            rows.append(Row(name, unit, start[name], value, None, None, "not to be used", note))
        elif unsure is None:
            std = found.plain_std.get(name, math.nan)
            note = f"{found.method} knows no noise"
            rows.append(
                Row(
                    name,
                    unit,
                    start[name],
                    value,
                    std if math.isfinite(std) else None,
                    None,
                    "estimated",
                    note if math.isfinite(std) else f"{note} and gives no standard error",
                )
            )
        elif name in unsure.undetermined:
            why = unsure.undetermined[name]
            rows.append(Row(name, unit, start[name], None, None, None, "not determined", why))
        else:
            std = float(unsure.std[unsure.names.index(name)])
            zero = name in unsure.near_zero
            rows.append(
                Row(
                    name,
                    unit,
                    start[name],
                    value,
                    std,
                    unsure.interval(name, value),
                    "not distinguishable from zero" if zero else "estimated",
                    _note(zero, found.by_form.get(name, 0.0) > MOSTLY * std),
                )
            )
    return rows


def _note(zero: bool, by_form: bool) -> str:
    said = ["it may as well be zero"] if zero else []
    said += ["the error covers other published forms of this law"] if by_form else []
    return "; ".join(said)


def as_text(row: Row) -> list[str]:
    """The row's cells for a table: name, unit, start, value, standard error, interval, remark."""
    if row.value is None:
        value, std, interval = "not determined", "–", "–"
    elif row.std is None:
        value, std, interval = f"{row.value:.6g}", "–", "–"
    elif row.interval is None:
        value, std, interval = rounded(row.value, row.std), error_text(row.std), "–"
    else:
        value, std = rounded(row.value, row.std), error_text(row.std)
        interval = " … ".join(rounded(end, row.std) for end in row.interval)
    unit = unit_text(row.unit)
    return [row.name, unit, f"{row.start:.6g}", value, std, interval, row.note or row.status]


HEADER = ["parameter", "unit", "start", "estimate", "std. error", "95 % interval", "remark"]
