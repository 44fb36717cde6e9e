"""The law of a map that was drawn."""

from __future__ import annotations

import numpy as np

from haptic_teleop_sim.model import Effect

from ..inverse_dynamics.groups import Search
from ..inverse_dynamics.latent import Latent, input_torque
from ..inverse_dynamics.motion import STILL
from .library import Product, library
from .regression import Law, sparse_law

#: Share of what the map explains that a law must explain to be suggested.
_LAW = 0.8
#: Cosine between the input and what is in proportion to it.
_PROPORTIONAL = 0.999
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
    products = [
        *library(
            search.model,
            effect.location,
            latent.place,
            effect.table.variables,
            float(angles.min()),
            float(angles.max()),
            float(np.max(np.abs(np.concatenate(rates)))),
        )
    ]
    both = {p for p in products if {"input", "velocity"} <= {factor.of for factor in p.factors}}
    if both and _goes_with_the_input(search):
        products = [p for p in products if p not in both]
    law = sparse_law(search, [p for p in products if not _is_the_input(search, p)])
    share = search.explained((latent,))
    return None if law is None or share <= 0.0 or law.explained < _LAW * share else law


def _is_the_input(search: Search, product: Product) -> bool:
    """Whether a product of the input alone is in proportion to it on these recordings, as its size is where
    it has one sign: that would explain all of the input, beside a joint of no inertia."""
    if any(factor.of != "input" for factor in product.factors):
        return False
    motions = [motion for side in search.sides for motion in side.side.motions]
    torque = np.concatenate([input_torque(motion.record, search.model) for motion in motions])
    values = np.prod([factor.values(torque) for factor in product.factors], axis=0)
    return bool(abs(values @ torque) > _PROPORTIONAL * np.linalg.norm(values) * np.linalg.norm(torque))


def _goes_with_the_input(search: Search) -> bool:
    """Whether the motor, where it moves, hardly ever does against the input: where friction carries nearly
    all of the torque, the size of the input with the sign of the velocity is the input, and would explain
    itself."""
    along = against = 0.0
    for motion in (m for side in search.sides for m in side.side.motions):
        speed = motion.while_held(motion.velocity[:, 0])
        moves = np.abs(speed) > STILL * np.max(np.abs(speed), initial=0.0)
        power = motion.record.input**2 * moves
        with_it = np.sign(speed) == np.sign(motion.record.input)
        along, against = along + float(power @ with_it), against + float(power @ ~with_it)
    return along - against > _THE_SAME * (along + against)
