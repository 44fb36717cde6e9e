"""Is an effect large enough to matter, and different enough from its simpler form to bear its own name?

A fit always finds *some* Stribeck dip or *some* difference between two directions.  Each effect's entry
states the least sizes at which its name says something: below, the simpler form (or none) stands.
"""

from __future__ import annotations

from haptic_teleop_sim.model import Effect

from ..inputs.scales import Scales
from .driving_friction import friction_drives


def material(effect: Effect, scales: Scales) -> bool:
    """Whether the effect, with these parameters, deserves its name on such a recording."""
    if friction_drives(effect, scales):
        return False
    practical = effect.entry.practical
    return practical is None or practical(effect.values, scales.at(effect.location))
