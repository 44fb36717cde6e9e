"""Are the innovations of a fit coloured by more than coarse encoders make them? Is what is left random?"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.records import Record

from ..evidence.fine_curve import follows_input_finely
from ..evidence.held_out import held_out_fit, with_both_kinds
from ..evidence.memory import Remembered, remembered
from ..evidence.null_records import expected_colour
from ..evidence.residual import Condition, conditions
from ..evidence.whiteness import colour, in_steps
from ..policy import COLOURED, MOST_BY_CHANCE, MOST_RANDOM, NOTICEABLE, STILL_RANDOM, STRUCTURED
from .adequacy import left_size

#: Factor over the colour of simulated recordings of the same fit, beyond which it is not the encoders'.
BY_ROUNDING = 2.0
#: Innovations (rms) in steps of the encoder, above which rounding is less than a twelfth of their power.
LARGER_THAN_STEPS = 1.0


def more_coloured(found: Sequence[float], fits: Sequence[tuple[Fit, Sequence[Record]]]) -> bool:
    """Whether innovations are clearly more coloured on all kinds of recordings than coarse encoders make
    those of a true model."""
    return all(c > BY_ROUNDING * expected_colour(*one) for c, one in zip(found, fits, strict=True))


def by_steps(found: tuple[float, float], fits: Sequence[tuple[Fit, Sequence[Record]]]) -> bool:
    """Whether innovations are as coloured as coarse encoders make those of a true model, and no larger than
    these encoders' steps: larger ones have another cause."""
    return all(in_steps(*one) < LARGER_THAN_STEPS for one in fits) and not more_coloured(found, fits)


def coloured(fit: Fit, estimation: Sequence[Record], validation: Sequence[Record]) -> bool:
    """Whether the innovations of a fit are coloured on both kinds of recordings, by more than coarse encoders
    make them: then its noise model does not hold, and its likelihoods are not to be taken at their word."""
    there = held_out_fit(fit, validation, [fit.noise])
    found = colour(fit, estimation), colour(there, validation)
    return min(found) > COLOURED and more_coloured(found, [(fit, estimation), (there, validation)])


def left_is_random(fit: Fit, estimation: Sequence[Record], validation: Sequence[Record]) -> bool:
    """Whether what a fit leaves is random as far as these recordings show: its innovations are white, and the
    left-over torque is no larger than chance is on a machine and follows nothing that was measured to speak
    of, with a memory or without, nor the input in detail."""
    both = *estimation, *validation
    return fit.once(("random", len(estimation)), both, lambda: _left_is_random(fit, estimation, validation))


def _left_is_random(fit: Fit, estimation: Sequence[Record], validation: Sequence[Record]) -> bool:
    if not left_size(fit, [*estimation, *validation]) <= MOST_RANDOM or coloured(fit, estimation, validation):
        return False
    found = conditions(fit, estimation, validation, fit.model.joint)
    if not all(c.explained <= STILL_RANDOM or _slight(c, fit, estimation) for c in found):
        return False
    if with_a_memory(fit, estimation, validation) is not None:
        return False
    return not in_detail(fit, estimation, validation)


def in_detail(fit: Fit, estimation: Sequence[Record], validation: Sequence[Record]) -> bool:
    """Whether a noticeable torque follows the input in detail (`follows_input_finely`)."""
    both = with_both_kinds(fit, estimation, validation)
    return follows_input_finely(both) > NOTICEABLE * driven(fit, estimation)


def with_a_memory(fit: Fit, estimation: Sequence[Record], validation: Sequence[Record]) -> Remembered | None:
    """What most of the left-over torque follows with a memory, if that part is more than chance is on a
    machine."""
    least = MOST_BY_CHANCE * driven(fit, estimation)
    found = remembered(fit, estimation, validation, fit.model.joint)
    enough = [one for one in found if one.explained >= STRUCTURED and one.size > least]
    return max(enough, key=lambda one: one.size, default=None)


def _slight(left: Condition, fit: Fit, estimation: Sequence[Record]) -> bool:
    """Whether what follows a quantity is too small a torque to be worth a word."""
    return left.size <= NOTICEABLE * driven(fit, estimation)


def driven(fit: Fit, records: Sequence[Record]) -> float:
    """Rms torque of the input, N·m."""
    input_ = np.sqrt(np.mean([np.mean(r.input**2) for r in records]))
    return float(abs(pack(fit.model).torque_constant) * input_)
