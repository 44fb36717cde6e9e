"""May a fitted effect be named at all: is it large enough to matter, and has it every size of its name?"""

from __future__ import annotations

import math

from haptic_teleop_sim.model import Effect

from ..inputs.scales import Scales
from .material import material


def admissible(effect: Effect, scales: Scales) -> bool:
    """Whether the effect is `material` and has all the sizes that its name asks for."""
    sizes = [
        effect.values[p.name] - p.neutral
        for p in effect.entry.parameters
        if p.default is None and p.neutral is not None and math.isfinite(p.neutral)
    ]
    # What is cheap to see comes first: most of what is fitted to noise alone has a size of zero.
    return all(math.isfinite(s) and s != 0.0 for s in sizes) and material(effect, scales)
