"""Parity equations solved: what they leave at the best parameters, and at the best response of the arm."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from haptic_teleop_sim.model import Model

from .arm_response import ArmResponse
from .parity_equations import Rows, Signals

FloatArray = NDArray[np.float64]

#: Factor by which the arm's response may differ from the model's.
_REACH = 4.0
#: Damping of the arm's response where that is looked for, and where the search begins, as a share of its
#: undamped frequency.
_DAMPED, _BEGINS = (1e-3, 4.0), (0.02, 1.0)
#: Step of the logarithms by which its derivatives are taken, how near it is found, and the first steps where
#: there are further least values.
_STEP, _CLOSE, _WIDE = 1e-4, 1e-3, 0.3
#: Samples that an equation needs for each of its columns.
_SAMPLES = 10
#: Added to the products of columns of length 1, so that those which are alike have a root.
_RIDGE = 1e-13


def best_arm_response(
    model: Model,
    parts: Sequence[Signals],
    rows: Callable[[Signals, ArmResponse, NDArray[np.intp]], Rows],
    descends: bool,
) -> list[ArmResponse]:
    """The arm's response with which the equation without an encoder leaves least, at the samples of each
    recording; ``descends``: what it leaves falls towards that from the model's, which takes a third of the
    time. That of an equation whose both sides go through the response has further least values."""
    p = model.parameters
    frequency = math.sqrt(p["stiffness"] / p["arm_inertia"])
    damped = float(np.clip(p["arm_damping"] / p["arm_inertia"] / frequency, *_BEGINS))
    given = np.log([frequency**2, damped * frequency])
    reach = (frequency**2 / _REACH, frequency**2 * _REACH), tuple(share * frequency for share in _DAMPED)
    bounds = np.log(reach)

    def arms(logarithms: FloatArray) -> list[ArmResponse]:
        stiffness, damping = np.exp(logarithms).tolist()
        return [ArmResponse(stiffness, damping, part.dt) for part in parts]

    def equations(logarithms: FloatArray) -> tuple[list[Rows], float]:
        found = [rows(part, arm, part.kept) for part, arm in zip(parts, arms(logarithms), strict=True)]
        return found, rms([one.target for one in found])

    def left(logarithms: FloatArray) -> FloatArray:
        found, whole = equations(logarithms)
        return np.concatenate(residuals(found)) / whole

    def share(logarithms: FloatArray) -> float:
        found, whole = equations(logarithms)
        return left_by(found) / whole

    if not len(left(given)):
        return arms(given)
    if descends:
        # Beside 1, because steps of derivatives are taken as shares.
        begin = given - 1.0
        close = {"diff_step": _STEP, "xtol": _CLOSE, "ftol": _CLOSE**2}
        found = scipy.optimize.least_squares(
            lambda one: left(one + begin), np.ones(2), bounds=bounds.T - begin, **close
        )
        return arms(found.x + begin)
    # Steps of its own would be shares of the logarithms, which may be none.
    simplex = given + _WIDE * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    options = {"initial_simplex": simplex, "xatol": _CLOSE, "fatol": _CLOSE}
    return arms(scipy.optimize.minimize(share, given, method="Nelder-Mead", bounds=bounds, options=options).x)


def counted(parts: Sequence[Signals], equations: Sequence[Rows]) -> list[Rows]:
    """The equations of all recordings at the samples that count."""
    return [one.at(part.kept) for part, one in zip(parts, equations, strict=True)]


def left_by(equations: Sequence[Rows]) -> float:
    """Rms that the equations of all recordings leave (see `solved`)."""
    return solved(equations)[0]


def solved(equations: Sequence[Rows]) -> tuple[float, FloatArray]:
    """Rms that the equations of all recordings leave with common parameters, by least squares, infinite with
    too few samples; and all parameters, the common ones first; what may have any sign is each recording's
    own."""
    common = equations[0].structure.shape[1]
    size = common + sum(one.free.shape[1] for one in equations)
    samples = sum(len(one.target) for one in equations)
    if samples < _SAMPLES * size:
        return math.inf, np.zeros(0)
    # Products of the columns and the target: the few numbers that least squares are of.
    products, mixed, whole, place = np.zeros((size, size)), np.zeros(size), 0.0, common
    for one in equations:
        own = np.r_[:common, place : (place := place + one.free.shape[1])]
        columns = np.column_stack([one.structure, one.free, one.target])
        among = columns.T @ columns
        products[np.ix_(own, own)] += among[:-1, :-1]
        mixed[own] += among[:-1, -1]
        whole += float(among[-1, -1])
    low, high = (np.full(size, side) for side in (-np.inf, np.inf))
    low[:common], high[:common] = np.transpose(equations[0].bounds)
    scale = np.sqrt(np.diag(products))
    shown = scale > 0.0
    scaled = products[np.ix_(shown, shown)] / np.outer(scale[shown], scale[shown])
    right = mixed[shown] / scale[shown]
    root = scipy.linalg.cholesky(scaled + _RIDGE * np.eye(len(scaled)))
    inside = scipy.linalg.solve_triangular(root, right, trans="T")
    bounds = (low * scale)[shown], (high * scale)[shown]
    found = scipy.optimize.lsq_linear(root, inside, bounds, method="bvls").x
    square = whole - 2.0 * float(found @ right) + float(found @ scaled @ found)
    factors = np.zeros(size)
    factors[shown] = found / scale[shown]
    return math.sqrt(max(square, 0.0) / (samples - len(found))), factors


def residuals(equations: Sequence[Rows]) -> list[FloatArray]:
    """What `solved` leaves of each recording's equation; nothing with too few samples."""
    _, factors = solved(equations)
    if not len(factors):
        return [np.zeros(0)]
    place = common = equations[0].structure.shape[1]
    found = []
    for one in equations:
        own = factors[place : (place := place + one.free.shape[1])]
        found.append(one.target - one.structure @ factors[:common] - one.free @ own)
    return found


def rms(parts: Sequence[FloatArray]) -> float:
    return max(float(np.sqrt(np.mean(np.concatenate(parts) ** 2))), 1e-300)
