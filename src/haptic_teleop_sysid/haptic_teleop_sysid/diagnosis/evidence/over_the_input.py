"""Is what is missing a function of the input alone? Then an actuator makes it, and no motion.

A servo valve, a series-wound motor or a command that overflows gives another torque than the command,
whatever the joint does. In a closed loop a curve over the motion explains much of that, too: which of them
explains more, where it was not fitted, tells. What is in proportion to the input is a scale of all torques,
and in no curve of it.
"""

from __future__ import annotations

from collections.abc import Sequence

from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.likelihood import FAILURES
from haptic_teleop_sysid.estimation.records import Record

from ..hypotheses.candidates import dry_friction
from ..hypotheses.follows import follows_from_motion
from ..policy import HOLDS_TOO, LEAST_EXPLAINED
from .inverse_dynamics.groups import Search
from .inverse_dynamics.latent import INPUT, measured_over
from .inverse_dynamics.regression import equations
from .inverse_dynamics.term import Term
from .inverse_dynamics.terms import Hypothesis


def terms_beside(model: Model, named: Sequence[Effect]) -> tuple[Term, ...]:
    """What is named and follows from the motion; and dry friction of the motor, where no friction is."""
    told = [e for e in named if follows_from_motion(e.entry)]
    if not any(e.entry.kind == "friction" for e in told):
        told.append(dry_friction(model))
    return tuple(Hypothesis.resized(e, model.place(e.location)) for e in told)


def over_the_input(
    model: Model,
    named: Sequence[Effect],
    estimation: Sequence[Record],
    validation: Sequence[Record],
    cutoff: float,
) -> bool:
    """Whether beside what is ``named`` and dry friction a curve over the input explains LEAST_EXPLAINED of
    the torque that is missing, where it was not fitted, and leaves less by HOLDS_TOO (rms) than any free
    curve over the motion. Not over time: any shape comes again in time. False where the arithmetic
    fails."""
    try:
        search = Search(model, *(equations(model, kind, cutoff) for kind in (estimation, validation)))
        beside = terms_beside(model, named)
        motions = [m for side in search.sides for m in side.side.motions]
        further = [*measured_over(model, motions, "motor")]
        own = [one for one in further if one.quantities == (INPUT,)]
        others = [
            one
            for one in (*search.latents, *further)
            if INPUT not in one.quantities and "time" not in one.quantities
        ]
        if not own or not others:
            return False
        without = 1.0 - search.explained(beside)
        left, elsewhere = (
            min(1.0 - search.explained((*beside, one)) for one in kind) for kind in (own, others)
        )
    except FAILURES:
        return False
    return left < (1.0 - LEAST_EXPLAINED) * without and elsewhere > HOLDS_TOO**2 * left
