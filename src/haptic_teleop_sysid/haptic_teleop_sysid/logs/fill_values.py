"""Numbers that loggers write where they have none: -9999, 1e30, the ends of integers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from haptic_teleop_control.counted import counted
from haptic_teleop_sysid.logs.log import Column

_FILL = (
    *(999.0, 9999.0, 99999.0, 999999.0, 9999999.0, 1e10, 1e20, 1e30, 1e35, 1e38, 1e99),
    *(9.969209968386869e36, 3.4028234663852886e38, 1.7976931348623157e308),  # NetCDF, float32, float64
    *(32767.0, 32768.0, 65535.0, 2147483647.0, 2147483648.0, 4294967295.0),
)
#: How many times larger than any other number a fill value is.
_BEYOND = 10.0
_NEAR = 1e-6


def without_fill(column: Column) -> Column:
    """Return a column with NaN for a number that only fills gaps: one of a known few, written in full, at
    least ten times as large as every other number; ``told`` then says so. Else the column itself."""
    values = column.values
    told = []
    for _ in range(2):  # one above, one below
        size = np.abs(values)
        most = float(np.max(size, where=np.isfinite(size), initial=0.0))
        if not any(abs(most - fill) <= _NEAR * fill for fill in _FILL):
            break
        filled = np.abs(size - most) <= _NEAR * most
        others = size[~filled & np.isfinite(size)]
        if not len(others) or most < _BEYOND * float(np.max(others)):
            break
        shown = values[np.argmax(filled)]
        told.append(f"{shown:.7g} in {counted(int(np.sum(filled)), 'row')}")
        values = np.where(filled, np.nan, values)
    if not told:
        return column
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    sentence = (
        f"{column.name!r} holds {' and '.join(told)}, far from all others ({low:.4g} to {high:.4g}): "
        "taken for `no reading`"
    )
    return replace(column, values=values, told=sentence)
