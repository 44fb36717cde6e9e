"""A model that simulates better than none, for physics without a name of which no map can be drawn.

A name that explains too little to be believed may still take most of the error off a simulation: friction
beside which a link bends in a way that is no spring's. The verdict stays `unknown`, and the nearest name
stands in, said to be nothing more, where it takes as much off the error of other recordings as a map must.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.fit import Fit

from ...evidence.measured_map import A_GOOD_PART
from ...evidence.second_method import Errors
from ..reasons import Doubt


@dataclass(frozen=True)
class StandIn:
    """``fit`` of the model with ``effects``, whose names are not believed; ``closed``: share of the simulated
    error on validation recordings that they take away."""

    fit: Fit
    effects: tuple[Effect, ...]
    closed: float

    def named(self, findings: Sequence[Mapping[str, Any]]) -> bool:
        """Whether each of its effects is one of the findings."""
        told = {(f["effect"], f["location"]) for f in findings}
        return all((e.effect, e.location) in told for e in self.effects)

    def why(self, findings: Sequence[Mapping[str, Any]]) -> str:
        """In words, beside the findings of the verdict."""
        names = " and ".join(f"{e.effect} at {e.location}" for e in self.effects)
        if self.named(findings):
            return (
                f"augmented_model.yaml has {names} with the size that simulates best, which takes on a part "
                f"of what has no name, too: {100 * self.closed:.0f} % less error on the validation "
                "recordings (than the better of your model and its re-estimate)"
            )
        return (
            f"augmented_model.yaml has the most similar effect{'s' if len(self.effects) > 1 else ''}, "
            f"{names}, as a stand-in that simulates better: it takes {100 * self.closed:.0f} % off the error "
            "on the validation recordings (of the better of your model and its re-estimate), and is not "
            "believed to be all that is missing"
        )

    def content(self, findings: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
        """For the result file, beside the findings of the verdict."""
        effects = [
            {"effect": e.effect, "location": e.location, "parameters": dict(e.values)} for e in self.effects
        ]
        return {"what": self.why(findings), "closed": round(self.closed, 3), "effects": effects}


def stand_in(base: Fit, given: Model, doubt: Doubt | None, errors: Errors) -> StandIn | None:
    """The fit that gave the doubtful name, if it simulates the validation recordings clearly better than
    ``base`` and the ``given`` model do, and those it was fitted to no worse; None otherwise."""
    if doubt is None or doubt.choice is None:
        return None
    fit = doubt.choice.chosen.fit
    more = fit.model.effects[len(base.model.effects) :]
    effects = tuple(e for e in more if not e.entry.nuisance)
    if not effects or any(e.entry.unnamed for e in effects):
        return None
    without, after = (errors(base.model), errors(given)), errors(fit.model)
    before = [min(pair) for pair in zip(*without, strict=True)]
    if not all(map(math.isfinite, after)) or after[0] > before[0]:
        return None
    closed = 1.0 - after[1] / max(before[1], 1e-300)
    return StandIn(fit, effects, closed) if closed >= A_GOOD_PART else None
