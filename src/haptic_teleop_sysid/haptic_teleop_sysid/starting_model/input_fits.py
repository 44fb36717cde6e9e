"""Least squares of a recorded input: by a structure's own columns, and with what real joints have beside."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.groups import independent
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.motion import BandedMotion
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.products import solved
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.regression import standard_errors

FloatArray = NDArray[np.float64]
UNSEEN = 0.5
"""Standard error, relative to the value, from which a parameter is not seen."""
EXPLAINS = 50.0
"""Fit of the input, %, below which a structure alone does not say what its parameters are."""
#: Factor by which a plain fit may leave more of the input than the fullest does, and fit from which it may
#: anyhow: otherwise its parameters stand for what it lacks.
_LEAVES, _NEARLY_ALL = 2.0, 90.0
#: Velocity, relative to its rms, within which dry friction turns.
_TURNS = 0.02


@dataclass(frozen=True)
class Fit:
    """Least squares of the input: ``values`` and ``errors`` of all columns, fit in ``percent``; ``beside``:
    the names of the columns behind the structure's."""

    values: FloatArray
    errors: FloatArray
    percent: float
    beside: tuple[str, ...]

    def seen(self, count: int) -> bool:
        """Whether the first ``count`` values are all known better than to UNSEEN."""
        return bool(np.all(self.errors[:count] < UNSEEN * self.values[:count]))


@dataclass(frozen=True)
class Solution:
    """Parameters of a structure: ``plain``: fit by the structure alone; ``chosen``: the fit that gives the
    parameters; ``values`` and ``std`` by parameter, in units of the input and of the angle; ``told``: what to
    know of them."""

    plain: Fit
    chosen: Fit
    values: dict[str, float]
    std: dict[str, float]
    told: tuple[str, ...]


def rows(
    motions: Sequence[BandedMotion], pick: Callable[[BandedMotion], FloatArray], times: int = 1
) -> FloatArray:
    """Return what ``pick`` takes of each motion, filtered ``times`` times, of all motions: (m,)."""
    return np.concatenate([m.filtered(pick(m), times) for m in motions])


def motor_columns(motions: Sequence[BandedMotion], structure: str) -> FloatArray:
    """Return the columns (m, 2 or 3) of the motor's equation: acceleration, velocity, and for a flexible
    joint the deflection."""
    found = [rows(motions, lambda m: m.acceleration[:, 0]), rows(motions, lambda m: m.velocity[:, 0])]
    if structure != "rigid_body":
        found.append(deflection(motions))
    return np.column_stack(found)


def deflection(motions: Sequence[BandedMotion]) -> FloatArray:
    """Return the deflection (m,) about its mean: encoders of motor and arm may count from different zeros,
    and what holds a mean is the constant's."""
    found = rows(motions, lambda m: m.angle[:, 0] - m.angle[:, 1])
    return found - np.mean(found)


def ladder(motions: Sequence[BandedMotion], columns: FloatArray, turns: bool) -> list[Fit]:
    """Return the fits of the input: by the columns (m, p) alone, with dry friction and a constant, and with
    gravity (for a linear axis a spring) as well."""
    target = rows(motions, lambda m: m.input)
    spread = max(float(np.std(np.concatenate([m.velocity[:, 0] for m in motions]))), 1e-300)
    dry = rows(motions, lambda m: np.tanh(m.velocity[:, 0] / (_TURNS * spread)), 2)
    friction = np.column_stack([dry, np.ones_like(dry)])
    if turns:
        pull = [
            rows(motions, lambda m: np.sin(m.angle[:, 0]), 2),
            rows(motions, lambda m: np.cos(m.angle[:, 0]), 2),
        ]
        names = ("gravity (sine)", "gravity (cosine)")
    else:
        pull, names = [rows(motions, lambda m: m.angle[:, 0])], ("spring",)
    count = columns.shape[1]
    steps = [
        ((), columns),
        (("dry friction", "a constant"), np.column_stack([columns, friction])),
        (("dry friction", "a constant", *names), np.column_stack([columns, friction, *pull])),
    ]
    # Dry friction, too, is none below zero.
    return [fitted(every, target, count + bool(beside), beside) for beside, every in steps]


def chosen_fit(fits: Sequence[Fit], count: int) -> Fit:
    """Return the plainest fit that explains the input about as well as any and shows the first ``count``
    parameters, else the one that explains most."""
    most = max(f.percent for f in fits)
    enough = max(EXPLAINS, min(100.0 - _LEAVES * (100.0 - most), _NEARLY_ALL))
    good = [f for f in fits if f.percent > enough and f.seen(count)]
    return good[0] if good else max(fits, key=lambda f: f.percent)


def fitted(columns: FloatArray, target: FloatArray, bounded: int, beside: tuple[str, ...]) -> Fit:
    """Return the least squares of the target (m,) by columns (m, p) whose first ``bounded`` values stay above
    zero; errors as of correlated residuals."""
    size = float(np.linalg.norm(target)) / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    low = np.full(columns.shape[1], -np.inf)
    low[:bounded] = 1e-6 * size[:bounded]
    values = solved(columns.T @ columns, columns.T @ target, low, np.full(columns.shape[1], np.inf))
    left = target - columns @ values
    spread = max(float(np.linalg.norm(target - target.mean())), 1e-300)
    lags = max(1, round(len(left) / max(independent(left), 1.0)))
    errors = standard_errors(columns, left, lags)
    return Fit(values, errors, 100.0 * (1.0 - float(np.linalg.norm(left)) / spread), beside)


def refuse_unseen(fit: Fit, joint: str, recording: str) -> None:
    """Raise RecordingError where the inertia, the first value of a fit, is not seen."""
    if not fit.seen(1):
        raise RecordingError(
            f"{recording}: the inertia of {joint} does not show in this motion (it explains "
            f"{fit.percent:.3g} % of the input): check sign and unit of the input, or record faster motion."
        )
