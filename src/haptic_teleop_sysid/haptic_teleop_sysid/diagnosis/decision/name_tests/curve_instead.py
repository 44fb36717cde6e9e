"""Names that a curve outdoes: drag that grows with a root of the speed comes near to dry friction, ligaments
to gravity, and what such a name leaves follows the angle or the speed wherever the joint goes.

Real machines leave something, too, and curves explain a part of it. But beside right names a curve that was
drawn on the estimation recordings takes little off the error of free runs of the validation recordings.
"""

from __future__ import annotations

from collections.abc import Callable

from ...evidence.measured_map import MeasuredMap
from ...evidence.second_method import Errors
from ...policy import OUTDONE_ERROR, OUTDONE_FROM, OUTDONE_TORQUE
from ..reasons import Doubt
from ..search.rounds import SearchResult


def outdone(
    result: SearchResult, errors: Errors, drawn: Callable[[SearchResult, float], MeasuredMap]
) -> tuple[SearchResult, Doubt | None]:
    """The result without its names, and the doubt that says why, where a map beside them explains
    OUTDONE_TORQUE of the torque that they leave and takes OUTDONE_ERROR off the error of free runs, both
    where it was not drawn from; the result as it is where one of them is seen in the currents alone.
    ``errors``: of free runs; ``drawn``: the map beside a result, tried in free runs where it explains that
    share at least."""
    moving = result.choices
    shown = any(c.chosen.by_current > 0.0 for c in moving)
    if not moving or shown or errors(result.final.model)[1] < OUTDONE_FROM:
        return result, None
    found = drawn(result, OUTDONE_TORQUE)
    if found.effect is None or found.explained is None or found.closed is None:
        return result, None
    if found.explained < OUTDONE_TORQUE or found.closed < OUTDONE_ERROR:
        return result, None
    names = " and ".join(f"{c.chosen.effect.effect} at {c.chosen.effect.location}" for c in moving)
    why = (
        f"beside the most similar effect, {names}, a torque over {' and '.join(found.quantities)} at "
        f"{found.effect.location} explains {100 * found.explained:.0f} % of what is missing still, and takes "
        f"{100 * found.closed:.0f} % off the error of free-run simulations, on recordings that it was not "
        "drawn from"
    )
    return result.without_names(moving, why), Doubt(moving[0], why, short=True)
