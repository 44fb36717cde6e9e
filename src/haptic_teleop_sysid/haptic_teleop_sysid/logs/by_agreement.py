"""Columns without names that say anything: which is the derivative of which, and which drives which."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import permutations

import numpy as np
import scipy
from numpy.typing import NDArray

from haptic_teleop_sysid.logs.evidence import NEAR, Relation, derivative_relation, relation, still
from haptic_teleop_sysid.logs.guess import PAIRS
from haptic_teleop_sysid.logs.log import Column
from haptic_teleop_sysid.logs.roles import Candidate
from haptic_teleop_sysid.logs.units import unit_of

Array = NDArray[np.float64]
#: Rows that are looked at, and columns: every pair of them is compared.
_ROWS, _COLUMNS = 10_000, 40
#: Columns among which a position and an input are looked for where no velocity is known.
_FEW = 8
#: Correlation from which one column is the integral of another; share of a column that motion must explain
#: for it to be the input, with and without a velocity that is known.
_DERIVED, _DRIVES, _DRIVES_ALONE = 0.98, 0.3, 0.6
#: Correlation with the speed from which a column is a measured one, if another column can be the input.
_SPEED = 0.98
#: Correlation with the derivative of a velocity from which a column is an acceleration: those are noisy.
_LIKE_A_RATE = 0.7
#: Rows over which a position is smoothed before it is differentiated.
_WINDOW = 21


def nameless(columns: Sequence[Column]) -> bool:
    """Whether the columns' names tell nothing of them: numbers alone, or one name and numbers."""
    return len(columns) > 1 and len({re.sub(r"\d+", "", c.name) for c in columns}) == 1


def by_agreement(columns: Sequence[Column], seconds: Array) -> list[Candidate]:
    """Return what columns are by their values alone, over times (n,) s: positions with the velocities that
    are their derivatives by a factor between units, and the inputs that the motion explains best."""
    rows = slice(0, _ROWS)
    time = seconds[rows]
    moving = [c for c in columns if len(c.values) == len(seconds) and not still(c.values[rows])][:_COLUMNS]
    pairs = _derived(moving, time)
    alone = [c for c in moving if all(c is not one for pair in pairs for one in pair[:2])]
    found: list[Candidate] = []
    if not pairs:
        return _without_velocity(moving, time)
    one_joint = len(pairs) == 1 or (len(pairs) == 2 and _together(pairs[0][0], pairs[1][0]))
    for number, (position, velocity, alike) in enumerate(pairs, start=1):
        joint = "" if one_joint else f"j{number}"
        pair = f"{position.name!r} and its derivative {velocity.name!r} go together (correlation {alike:.4f})"
        found += [
            _candidate(position, "position", joint, f"position by its values: {pair}"),
            _candidate(velocity, "velocity", joint, f"velocity by its values: {pair}"),
        ]
    for joint, (position, velocity, _) in zip([""] if one_joint else [c.joint for c in found[::2]], pairs,
                                              strict=False):  # fmt: skip
        speed = velocity.values[rows]
        shares = [(_share(c.values[rows], time, speed), c) for c in alone]
        shares = [(s, c) for s, c in shares if not _acceleration(time, velocity, c)]
        if shares and (best := max(shares, key=lambda s: s[0]))[0] > _DRIVES:
            why = (
                f"input by its values: the motion of {position.name!r} explains {100.0 * best[0]:.0f} % of it"
            )
            found.append(_candidate(best[1], "input", joint, why))
            alone = [c for c in alone if c is not best[1]]
    return found


def _candidate(column: Column, role: str, joint: str, why: str) -> Candidate:
    return Candidate(column, role, "", joint, False, False, False, why)


def _derived(columns: Sequence[Column], time: Array) -> list[tuple[Column, Column, float]]:
    """(position, velocity, correlation), each column once; what is nobody's derivative comes first."""
    likely = []
    for position, velocity in permutations(columns, 2):
        found = derivative_relation(time, position.values[: len(time)], velocity.values[: len(time)])
        if found is not None and abs(found.alike) > _DERIVED and _between_units(found.ratio):
            likely.append((position, velocity, abs(found.alike)))
    derived = {id(velocity) for _, velocity, _ in likely}
    pairs: list[tuple[Column, Column, float]] = []
    used: set[int] = set()
    for position, velocity, alike in sorted(likely, key=lambda p: (id(p[0]) in derived, -p[2])):
        if not {id(position), id(velocity)} & used:
            pairs.append((position, velocity, alike))
            used |= {id(position), id(velocity)}
    return sorted(pairs, key=lambda p: next(i for i, c in enumerate(columns) if c is p[0]))


def _between_units(ratio: float) -> bool:
    for pair in PAIRS:
        position, velocity = (unit_of(name) for name in pair)
        if position and velocity and abs(abs(ratio) * position.factor / velocity.factor - 1.0) < NEAR:
            return True
    return False


def _without_velocity(columns: Sequence[Column], time: Array) -> list[Candidate]:
    """The position and the input whose equation of motion explains most, and a second position beside it."""
    step = float(np.median(np.diff(time))) if len(time) > _WINDOW else 0.0
    if not step > 0.0:
        return []
    tried = []
    for position, drive in permutations(columns[:_FEW], 2):
        values = [c.values[: len(time)] for c in (position, drive)]
        if not all(np.all(np.isfinite(v)) for v in values):
            continue
        speed = np.asarray(scipy.signal.savgol_filter(values[0], _WINDOW, 3, deriv=1, delta=step))
        smooth = np.asarray(scipy.signal.savgol_filter(values[1], _WINDOW, 3))
        measured = _alike(relation(smooth, speed), _SPEED)
        tried.append((_share(smooth, time, speed), measured, position, drive))
    if not tried or (best := max(tried, key=lambda t: t[0]))[0] < _DRIVES_ALONE:
        return []
    share, speed_alone, position, drive = best
    # A column that is the speed and nothing else is measured, if the same motion explains another one, too.
    # A second position and an acceleration drive nothing.
    others = [
        t for t in tried
        if t[2] is position and t[3] is not drive and t[0] >= _DRIVES_ALONE
        and not _together(position, t[3]) and not _alike(_rate(time, drive, t[3]), _LIKE_A_RATE)
    ]  # fmt: skip
    if speed_alone and others:
        share, _, _, drive = max(others, key=lambda t: t[0])
    why = f"by its values: the motion of {position.name!r} explains {100.0 * share:.0f} % of {drive.name!r}"
    pair = [
        _candidate(position, "position", "", f"position {why}"),
        _candidate(drive, "input", "", f"input {why}"),
    ]
    beside = [c for c in columns if c not in (position, drive) and _together(position, c)]
    return pair + [
        _candidate(c, "position", "", f"position by its values: it goes along with {position.name!r}")
        for c in beside[:1]
    ]


def _alike(found: Relation | None, least: float) -> bool:
    return found is not None and abs(found.alike) > least


def _rate(time: Array, velocity: Column, other: Column) -> Relation | None:
    """How a column goes along with the derivative of a velocity."""
    return derivative_relation(time, velocity.values[: len(time)], other.values[: len(time)])


def _share(drive: Array, time: Array, speed: Array) -> float:
    """Share (0 to 1) of an input that inertia, damping, dry friction and a constant explain."""
    good = np.isfinite(drive) & np.isfinite(speed)
    if np.sum(good) < 2 * _WINDOW:
        return 0.0
    u, v = drive[good], speed[good]
    smooth = np.asarray(scipy.signal.savgol_filter(v, _WINDOW, 3))
    acceleration = np.gradient(smooth)
    columns = np.column_stack([acceleration, smooth, np.sign(smooth), np.ones_like(smooth)])
    columns /= np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    left = u - columns @ np.linalg.lstsq(columns, u, rcond=None)[0]
    return 1.0 - float(np.var(left) / max(float(np.var(u)), 1e-300))


def _acceleration(time: Array, velocity: Column, other: Column) -> bool:
    found = _rate(time, velocity, other)
    return found is not None and found.alike > _DERIVED and abs(found.ratio - 1.0) < NEAR


def _together(one: Column, other: Column) -> bool:
    """Whether two positions may be those of motor and arm of one joint."""
    found = relation(one.values, other.values)
    return found is not None and abs(found.alike) > 0.9 and 0.5 < abs(found.ratio) < 2.0
