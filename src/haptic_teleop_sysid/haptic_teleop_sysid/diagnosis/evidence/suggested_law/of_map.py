"""The law of a map that was drawn."""

from __future__ import annotations

import numpy as np

from haptic_teleop_sim.model import Effect

from ..inverse_dynamics.groups import Search
from ..inverse_dynamics.latent import Latent
from .library import library
from .regression import Law, sparse_law

#: Share of what the map explains that a law must explain to be suggested.
_LAW = 0.8
#: Correlation with the input from which its size with the sign of the velocity says the same.
_THE_SAME = 0.9


def law_of(search: Search, latent: Latent, effect: Effect) -> Law | None:
    """The law of a drawn map; None where none explains a good part of what the map does, and for a torque of
    the joint that follows the motor: an entry's equation knows the deflection there, and no other angle."""
    if latent.place == "joint" and any(q.startswith("motor") for q in latent.quantities):
        return None
    motions = [m for side in search.sides for m in side.side.motions]
    part = int(latent.place == "arm")
    joint = latent.place == "joint"
    angles = np.concatenate([m.angle[:, 0] - m.angle[:, 1] if joint else m.angle[:, part] for m in motions])
    rates = [m.velocity[:, 0] - m.velocity[:, 1] if joint else m.velocity[:, part] for m in motions]
    assert effect.table is not None
    products = library(
        search.model,
        effect.location,
        latent.place,
        effect.table.variables,
        float(angles.min()),
        float(angles.max()),
        float(np.max(np.abs(np.concatenate(rates)))),
    )
    if _goes_with_the_input(search):
        products = (p for p in products if all(factor.of != "input" for factor in p.factors))
    law = sparse_law(search, [*products])
    share = search.explained((latent,))
    return None if law is None or share <= 0.0 or law.explained < _LAW * share else law


def _goes_with_the_input(search: Search) -> bool:
    """Whether the motor hardly ever moves against the input: where friction carries nearly all of the torque,
    the size of the input with the sign of the velocity is the input, and would explain itself."""
    motions = [m for side in search.sides for m in side.side.motions]
    input_ = np.concatenate([m.record.input for m in motions])
    forward = np.concatenate([np.sign(m.at_all_samples(m.velocity[:, 0])) for m in motions])
    own = float(np.sum(input_**2))
    return float(np.sum(np.abs(input_) * forward * input_)) > _THE_SAME * own
