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
    law = sparse_law(search, [*products])
    share = search.explained((latent,))
    return None if law is None or share <= 0.0 or law.explained < _LAW * share else law
