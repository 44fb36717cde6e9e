"""Parameters that the recordings do not determine keep the value that the search started from.

Where the search ended with them says nothing, and what was known before may be right. The others are fitted
again beside it. Where they cannot make up for it, the recordings contradict the start, which is worse then
than what the search found.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from haptic_teleop_sim.model import STRUCTURES, parameter_bounds

from .fit import Fit
from .prediction_fit import fit_parameters
from .records import Record
from .result import Estimate
from .step_limits import Limits
from .uncertainty import MEMORY, uncertainty
from .whole_fit import fit_whole

#: Nats below the best from which the recordings contradict a start: three standard errors.
CONTRADICTED = 4.5
_ITERATIONS = 30


def with_starts_kept(found: Estimate, records: Sequence[Record], limits: Limits | None = None) -> Estimate:
    """The estimate with its undetermined parameters as the start has them, named in ``kept``, and the others
    fitted anew beside them; as it is where none can be kept.

    Those of which the recordings know a combination stay, and what ended at a bound that makes sense: there
    the recordings do say something."""
    fit, unsure = found.fit, found.uncertainty
    if fit is None or unsure is None:
        return found
    kept = tuple(n for n in unsure.undetermined if n not in unsure.combined and _idle(found, fit, n))
    rest = tuple(n for n in fit.free if n not in kept)
    if not kept or not rest:
        return found
    start = found.start.parameter_values()
    model = fit.model.with_values({name: start[name] for name in kept})
    if found.misled is None:
        again = fit_whole(model, fit.noise, records, free=rest, iterations=_ITERATIONS, limits=limits)
        memory = MEMORY
    else:
        again = fit_parameters(model, fit.noise, records, free=rest, iterations=_ITERATIONS, limits=limits)
        memory = max(MEMORY, found.misled.ahead)
    if not again.converged or not again.log_likelihood > fit.log_likelihood - CONTRADICTED:
        return found
    anew = uncertainty(again, records, memory, tuned=found.misled is None)
    why = {name: unsure.undetermined[name] for name in kept}
    anew = replace(anew, undetermined=why | anew.undetermined)
    return replace(found, model=again.model, fit=again, uncertainty=anew, kept=kept)


def _idle(found: Estimate, fit: Fit, name: str) -> bool:
    """Whether the search left a parameter where nothing can be read from it."""
    if name not in fit.at_bound:
        return True
    lowest = parameter_bounds(found.model, name)[0]
    floor = name in STRUCTURES[found.model.structure] and lowest > 0.0
    return floor and found.model.parameter_values()[name] <= 2.0 * lowest
