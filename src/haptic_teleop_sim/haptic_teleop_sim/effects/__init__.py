"""Effects: physics beyond the structure, each written once (see ``entry.py``)."""

from .entry import EffectEntry
from .parameter import EffectParameter
from .registry import EFFECTS, MEASURED, effect_entry, locations

__all__ = ["EFFECTS", "MEASURED", "EffectEntry", "EffectParameter", "effect_entry", "locations"]
