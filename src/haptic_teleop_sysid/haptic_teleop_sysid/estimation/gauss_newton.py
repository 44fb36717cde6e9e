"""Damped Gauss-Newton steps within bounds, whatever is fitted: the loop, and nothing of models."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Equations = tuple[FloatArray, FloatArray]
"""Information (p, p) and gradient (p,) of the negative log-likelihood."""

#: A step relatively smaller than this is rounding.
_RESOLUTION = 1e-8
#: Log-likelihood that a step may promise and not keep at the top.
_NEXT_TO_NOTHING = 1.0
#: Factor by which damping rises after a step that gains nothing, and falls after one that does at once.
_FACTOR = 30.0


class Point(Protocol):
    """Where parameters lead: their log-likelihood."""

    @property
    def value(self) -> float: ...


P = TypeVar("P", bound=Point)


@dataclass(frozen=True)
class Damping:
    """In units of the scaled information: ``first`` of all; at least ``raised`` after a step that gains
    nothing; at most lowered to ``least``; ``tries``: of a step."""

    first: float
    raised: float
    least: float
    tries: int


@dataclass(frozen=True)
class Problem(Generic[P]):
    """What is maximised.

    ``at`` (theta, point before, damping): the point there, None where nothing is predicted or it costs too
    much; ``equations`` (point, theta): None where they overflow; ``limited`` (point, theta, theta wanted): no
    further than one step may go; ``low``, ``high`` (p,).
    """

    at: Callable[[FloatArray, P, float], P | None]
    equations: Callable[[P, FloatArray], Equations | None]
    limited: Callable[[P, FloatArray, FloatArray], FloatArray]
    low: FloatArray
    high: FloatArray


@dataclass(frozen=True)
class End(Generic[P]):
    """Where it ends. ``information``, ``gradient``: those of the last step's beginning."""

    theta: FloatArray
    point: P
    information: FloatArray
    gradient: FloatArray
    converged: bool
    message: str
    count: int


def maximise(
    problem: Problem[P],
    theta: FloatArray,
    point: P,
    damped: Damping,
    *,
    iterations: int,
    enough: float,
    progress: Callable[[int, float], None] | None = None,
) -> End[P]:
    """From parameters (p,) and their point to where a step promises less than ``enough`` of log-likelihood,
    gains less than a tenth of that or all that there was to gain up to a tenth of that, or where no damped
    step gains anything."""
    damping, count, converged = damped.first, 0, False
    message = "stopped at the limit of iterations"
    information, gradient = np.zeros((len(theta), len(theta))), np.zeros(len(theta))
    while count < iterations:
        count += 1
        found = problem.equations(point, theta)
        if found is None:
            message = "its derivatives overflow"
            break
        information, gradient = found
        active = ~((theta <= problem.low) & (gradient > 0)) & ~((theta >= problem.high) & (gradient < 0))
        whole = gauss_newton_step(information, gradient, 0.0, active)
        promised = abs(0.5 * float(gradient @ whole))
        if promised < enough:
            converged, message = True, "converged"
            break
        if np.all(np.abs(whole) <= _RESOLUTION * np.maximum(np.abs(theta), 1e-12)):
            # Data without noise: the likelihood gains without end by ever smaller residuals.
            converged, message = True, "at the resolution of the arithmetic"
            break
        tried = damping
        for _ in range(damped.tries):
            step = gauss_newton_step(information, gradient, damping, active)
            new = problem.limited(point, theta, np.clip(theta + step, problem.low, problem.high))
            trial = problem.at(new, point, damping)
            if trial is not None and trial.value > point.value:
                break
            damping = max(_FACTOR * damping, damped.raised)
        else:
            converged = promised < _NEXT_TO_NOTHING
            message = "no step gains anything: the model bends too much here or is at its best"
            break
        gained, moved = trial.value - point.value, new - theta
        told = -float(gradient @ moved) - 0.5 * float(moved @ information @ moved)
        theta, point = new, trial
        # What this step needed the next one is likely to need, too.
        damping = damping if damping > tried else max(damping / _FACTOR, damped.least)
        if progress is not None:
            progress(count, point.value)
        if min(gained, (promised - told) + abs(told - gained)) < 0.1 * enough:
            # Where the model has kinks, steps promise what they do not hold. Where one holds it, what is left
            # is what the whole step would have gained more, and some times what this one was wrong by: where
            # a direction bends ten times less than it seems, nine times.
            converged, message = True, "converged"
            break
    return End(theta, point, information, gradient, converged, message, count)


def gauss_newton_step(
    information: FloatArray, gradient: FloatArray, damping: float, active: NDArray[np.bool_]
) -> FloatArray:
    """Damped step (p,) in parameters scaled to unit information; inactive and unexcited ones stay."""
    scale = np.sqrt(np.maximum(np.diag(information), 0.0))
    active = active & (scale > 1e-150)
    step = np.zeros(len(gradient))
    if not np.any(active):
        return step
    s = scale[active]
    a = information[np.ix_(active, active)] / np.outer(s, s)
    step[active] = -np.linalg.lstsq(a + damping * np.eye(len(s)), gradient[active] / s, rcond=1e-12)[0] / s
    return step
