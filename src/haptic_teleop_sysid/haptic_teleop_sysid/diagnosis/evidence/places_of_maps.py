"""Which free curves can be measured: over one or two quantities of the motion, at one place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import FAILURES
from haptic_teleop_sysid.estimation.records import Record

from .drawn_map import VARIABLES, finer
from .inverse_dynamics.groups import Search
from .inverse_dynamics.latent import IN_A_TURN, INPUT, Latent, measured_over
from .inverse_dynamics.regression import equations

#: Share of the plane of input and angle that the motion fills, in rows and columns that hold as many samples,
#: from which a surface over both is drawn: round one loop, which fills about half, it may be anything that
#: comes again with the loop. By hand: of 38 motions of two draws of physics outside the table none fills less
#: than 0.88; a wrist's slow sine, where a surface took the place of friction, 0.58.
FILLED, PARTS = 0.7, 8
#: Share of the samples that a part would have if all had as many, from which it counts as filled.
ENOUGH = 0.25


@dataclass(frozen=True)
class Place:
    """Free curves that were drawn with one ``search``: ``maps``, best first and as fine as the
    recordings allow, and the best ``other``, which no map can follow."""

    search: Search
    maps: list[Latent]
    other: Latent | None

    def best(self, most: int) -> list[tuple[Search, Latent]]:
        """The ``most`` best maps, and the best curve, each with the search that draws it."""
        curve = next((one for one in self.maps if len(one.quantities) == 1), None)
        best = self.maps[:most]
        return [(self.search, one) for one in (best if curve is None or curve in best else [*best, curve])]


def places_of(
    base: Fit, given: Model, estimation: Sequence[Record], validation: Sequence[Record], cutoff: float
) -> list[Place]:
    """Torques at motor and arm beside a structure that is free, and torques of the joint beside inertias and
    a spring as they were fitted: beside free ones such a torque can take the spring's place, with an arm of
    no inertia behind it, and the equations hold as well."""
    model = replace(given, effects=base.model.effects, fixed=base.model.fixed)
    free = _equations(model, estimation, validation, cutoff)
    places = ("motor",) if model.rigid else ("motor", "arm")
    found = [_place(free, [*(one for one in free.latents if one.place != "joint"), *_further(free, *places)])]
    if not model.rigid:
        model = model.with_values(dict(base.model.parameters))
        model = replace(model, fixed=(*model.fixed, "stiffness", "motor_inertia", "arm_inertia"))
        held = _equations(model, estimation, validation, cutoff)
        along = [one for one in held.latents if one.place == "joint"]
        found.append(_place(held, [*along, *_further(held, "joint")]))
    return found


def _further(search: Search, *places: str) -> list[Latent]:
    motions = [m for side in search.sides for m in side.side.motions]
    return [one for place in places for one in measured_over(search.model, motions, place)]


def _place(search: Search, latents: Sequence[Latent]) -> Place:
    ranked = sorted(latents, key=lambda one: search.left_over((one,)))
    maps = [one for one in ranked if all(q.removesuffix(IN_A_TURN) in VARIABLES for q in one.quantities)]
    other = next((one for one in ranked if one not in maps), None)
    maps = [one for one in maps if _fills(search, one)]
    # A coarse one says little of what a finer one explains.
    maps = [one for coarse in maps if (one := _as_fine(search, coarse)) is not None]
    return Place(search, sorted(maps, key=lambda one: search.left_over((one,))), other)


def _fills(search: Search, latent: Latent) -> bool:
    """Whether the motion fills enough of the plane of a surface over the input; any other torque may be
    drawn."""
    if len(latent.quantities) == 1 or INPUT not in latent.quantities:
        return True
    return filled(*map(np.array, latent.samples)) >= FILLED


def filled(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Share of PARTS x PARTS parts of the plane of two quantities (n,) that hold ENOUGH samples, of n in the
    hundreds; each row and each column holds the same number, but for equal values, which share one."""
    ranks = [(rankdata(values, method="min") - 1.0) / len(values) for values in (one, other)]
    along, across = ((PARTS * rank).astype(np.intp) for rank in ranks)
    count = np.bincount(PARTS * along + across, minlength=PARTS**2)
    return float(np.mean(count >= ENOUGH * len(one) / PARTS**2))


def _as_fine(search: Search, coarse: Latent) -> Latent | None:
    """A map as fine as the recordings allow; None where its arithmetic fails."""
    try:
        return finer(search, coarse)
    except FAILURES:
        return None


def _equations(
    model: Model, estimation: Sequence[Record], validation: Sequence[Record], cutoff: float
) -> Search:
    search = Search(model, *(equations(model, records, cutoff) for records in (estimation, validation)))
    best = min(search.latents, key=lambda one: search.left_over((one,)), default=None)
    terms = () if best is None else (best,)
    search.count(terms)
    return search
