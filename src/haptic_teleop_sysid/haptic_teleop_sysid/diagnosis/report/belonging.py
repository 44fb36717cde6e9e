"""Do the recordings belong together? Another unit, sign or machine in one of them is no missing physics."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from haptic_teleop_sysid.simulation.fit import SimulatedFit

from ..evidence.proof import MODELS, Proof
from .summary import percent

#: Least simulated fit (percent) of every velocity of the recordings fitted to from which a model follows
#: them.
FOLLOWED = 50.0
#: Share of that fit below which other recordings are not followed.
APART = 0.1


def apart(proof: Proof) -> dict[str, Any] | None:
    """For the result file: recordings of which no model follows all velocities, or hardly better than their
    means, although one follows those that it was fitted to; None where there are none."""
    followed = max(_worst(proof.fits[model]["estimation"]) for model in MODELS)  # NaN where none moves
    if not followed >= FOLLOWED:
        return None
    found: list[str] = []
    best = -float("inf")
    for part in ("validation", "test"):
        for number, dataset in enumerate(proof.parts[part]):
            here = max(_worst([proof.fits[model][part][number]]) for model in MODELS)
            if here < APART * followed:
                found.append(dataset.name)
                best = max(best, here)
    if not found:
        return None
    what = (
        f"no model follows {', '.join(found)} (fit of a velocity {percent(best)} % at best), while "
        f"the recordings fitted to are followed with {followed:.0f} %"
    )
    remedy = "see whether they have the units, the signs, the input, the joint and the load of the others"
    return {"recordings": found, "what": what, "remedy": remedy}


def _worst(fits: Sequence[SimulatedFit]) -> float:
    """The smallest fit of a velocity that is not constant, percent."""
    found = [p for fit in fits for name, p in fit.percent.items() if name.endswith(".velocity")]
    return min((p for p in found if p == p), default=float("nan"))
