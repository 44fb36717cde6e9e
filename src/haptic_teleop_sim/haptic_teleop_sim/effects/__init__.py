"""Effects: physics beyond the structure, each written once (see ``entry.py``)."""

from .entry import EffectEntry, EffectParameter
from .registry import EFFECTS, effect_entry, locations

__all__ = ["EFFECTS", "EffectEntry", "EffectParameter", "effect_entry", "locations"]
