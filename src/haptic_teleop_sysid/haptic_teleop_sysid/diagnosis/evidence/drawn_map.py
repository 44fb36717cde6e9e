"""A free curve as a map: how fine, with which numbers, and how much it explains where it was not
drawn from."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.effects import MEASURED
from haptic_teleop_sim.effects.torque_map import TorqueMap
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.simulation.covariance import scaled_inverse

from .inverse_dynamics.groups import CLEARLY, Search
from .inverse_dynamics.latent import IN_A_TURN, INPUT, Latent

FloatArray = NDArray[np.float64]

#: Knots of a curve or a surface up to which it is made finer.
MOST_KNOTS = 100
#: What the quantities of a free curve are called in a model file.
VARIABLES = {
    "motor angle": "angle",
    "arm angle": "angle",
    "motor velocity": "velocity",
    "arm velocity": "velocity",
    "deflection": "deflection",
    "rate of deflection": "deflection_rate",
    INPUT: "input",
}


def _rows(search: Search, latent: Latent) -> slice | int:
    """The equations in which a torque stands."""
    return slice(None) if latent.place == "joint" or search.model.rigid else int(latent.place == "arm")


def finer(search: Search, latent: Latent) -> Latent:
    """The curve or surface with twice as many knots along the quantity by which that gains most, and so on,
    as long as it explains clearly more where it was not fitted."""
    while math.prod(map(len, latent.knots)) < MOST_KNOTS:
        tried = [_denser(latent, axis) for axis in range(len(latent.knots))]
        best = max(tried, key=lambda one: search.likelier((one,)))
        taken = search.likelier((best,)) >= search.likelier((latent,)) + CLEARLY
        search.forget([one for one in (*tried, latent) if one is not (best if taken else latent)])
        if not taken:
            break
        latent = best
    return latent


def _denser(latent: Latent, axis: int) -> Latent:
    """With a further knot between any two along one quantity."""
    old = np.array(latent.knots[axis])
    between = np.sort(np.concatenate([old, 0.5 * (old[1:] + old[:-1])]))
    knots = (*latent.knots[:axis], tuple(between.tolist()), *latent.knots[axis + 1 :])
    return replace(latent, knots=knots)


def explained_there(search: Search, latent: Latent) -> float:
    """Share of what the structure leaves of the equations in which a torque stands that it explains (mean
    square), fitted to either kind of recordings and judged by the other."""
    rows = _rows(search, latent)
    before = after = 0.0
    for k, side in enumerate(search.sides):
        for terms in ((), (latent,)):
            left = side.left(terms, search.fitted(1 - k, terms)).reshape(-1, side.samples)[rows]
            square = float(np.mean(left**2))
            before, after = (before, after + square) if terms else (before + square, after)
    return 1.0 - after / max(before, 1e-300)


def drawn(search: Search, latent: Latent) -> Effect:
    """The map of a free curve as the first side's equations have it, with standard errors beside
    the structure's parameters as they come out: those of a curve as smooth as the regression expects, wide
    where no motion went, with what the other side would have it apart."""
    terms, side = (latent,), search.sides[0]
    values = search.fitted(0, terms)
    own, rest = slice(len(side.side.names), None), slice(len(side.side.names))
    scale, scaled, _ = scaled_inverse(side.information(terms)[0][own, own])
    inverse = np.diag(scaled) / scale**2
    left = side.left(terms, values).reshape(-1, side.samples)[_rows(search, latent)]
    # Neighbouring samples say the same: so many count for one.
    alike = side.samples / max(min(search.numbers[0], side.samples), 1.0)
    there, mixed = search.sides[1].information(terms)
    other = np.linalg.lstsq(there[own, own], mixed[own] - there[own, rest] @ values[rest], rcond=1e-12)[0]
    apart = (values[own] - other) / math.sqrt(2.0)
    errors = np.sqrt(np.maximum(inverse, 0.0) * float(np.mean(left**2)) * alike + apart**2)
    arm = side.side.arm_scale(values) if latent.place == "arm" else 1.0
    shape = [len(k) for k in latent.knots]
    torque, std = ((arm * v).reshape(shape) for v in (values[own], errors))
    knots = list(latent.knots)
    if latent.quantities[0].endswith(IN_A_TURN):
        motions = [m for one in search.sides for m in one.side.motions]
        angles = np.concatenate([m.angle[:, int(latent.place == "arm")] for m in motions])
        knots[0], torque, std = _turned(knots[0], torque, std, float(angles.min()), float(angles.max()))
    table = TorqueMap(
        tuple(VARIABLES[q.removesuffix(IN_A_TURN)] for q in latent.quantities),
        tuple(knots),
        tuple(torque.ravel().tolist()),
        tuple(std.ravel().tolist()),
    )
    return Effect(MEASURED.name, latent.location, table=table)


def _turned(
    turn: tuple[float, ...], torque: FloatArray, std: FloatArray, lowest: float, highest: float
) -> tuple[tuple[float, ...], FloatArray, FloatArray]:
    """Knots, torques and errors of one turn, again and again over all turns from ``lowest`` to ``highest``,
    rad, and one further on either side."""
    whole = 2.0 * math.pi
    turns = range(math.floor(lowest / whole) - 1, math.floor(highest / whole) + 2)
    knots = [k + whole * n for n in turns for k in turn[:-1]]
    again = [np.concatenate([part[:-1]] * len(turns)) for part in (torque, std)]
    return tuple(knots), again[0], again[1]
