"""A torque without a form as a map: how fine, with which numbers, and how much it explains where it was not
drawn from."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from haptic_teleop_sim.effects import MEASURED
from haptic_teleop_sim.effects.torque_map import TorqueMap
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.simulation.covariance import scaled_inverse

from .inverse_dynamics.groups import CLEARLY, Search
from .inverse_dynamics.latent import Latent

#: Knots of a curve at most.
MOST_KNOTS = 100
#: What the quantities of a torque without a form are called in a model file.
VARIABLES = {
    "motor angle": "angle",
    "arm angle": "angle",
    "motor velocity": "velocity",
    "arm velocity": "velocity",
    "deflection": "deflection",
    "rate of deflection": "deflection_rate",
}


def _rows(search: Search, latent: Latent) -> slice | int:
    """The equations in which a torque stands."""
    return slice(None) if latent.place == "joint" or search.model.rigid else int(latent.place == "arm")


def finer(search: Search, latent: Latent) -> Latent:
    """The curve with twice as many knots, and so on, as long as it explains clearly more where it was not
    fitted; a surface as it is."""
    while len(latent.knots) == 1 and len(latent.knots[0]) < MOST_KNOTS:
        old = np.array(latent.knots[0])
        knots = np.sort(np.concatenate([old, 0.5 * (old[1:] + old[:-1])]))
        denser = replace(latent, knots=(tuple(knots.tolist()),))
        if search.likelier((denser,)) < search.likelier((latent,)) + CLEARLY:
            break
        latent = denser
    return latent


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
    """The map of a torque without a form as the first side's equations have it, with standard errors beside
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
    table = TorqueMap(
        tuple(VARIABLES[q] for q in latent.quantities),
        latent.knots,
        tuple((arm * values[own]).tolist()),
        tuple((arm * errors).tolist()),
    )
    return Effect(MEASURED.name, latent.location, table=table)
