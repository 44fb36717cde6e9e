"""The second of two effects by itself: is the first worth anything beside it?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.step_limits import Limits
from haptic_teleop_sysid.estimation.whole_fit import fit_whole

from ...evidence.held_out import judged
from ...hypotheses.explanation import Explanation
from ...hypotheses.twins import with_twins
from ...inputs.scales import Scales
from ...policy import LEAST_GAIN
from ...starts.trials import LAST_STEPS, with_companion
from .decide import Choice


def without_the_first(
    baseline: Fit,
    second: Choice,
    estimation: Sequence[Record],
    validation: Sequence[Record],
    scales: Scales,
    limits: Limits,
) -> list[Explanation]:
    """The second of two effects, and what it is not told from, as explanations by themselves, if the first is
    worth nothing beside it: then the first was but the nearest that could be seen before."""
    alone = _without_first(second.chosen, baseline, estimation, limits)
    if not alone.log_likelihood > second.chosen.fit.log_likelihood - LEAST_GAIN:
        return []
    fits = [alone, *(_without_first(e, baseline, estimation, limits) for e in _others(second))]
    return with_twins(judged(baseline, fits, estimation, validation, scales))


def _others(choice: Choice) -> list[Explanation]:
    """What a choice is not told from, without the twins of what is there, which are the same fit."""
    seen, found = {choice.chosen.fit.log_likelihood}, []
    for e, _ in choice.others:
        if e.beside is None and e.fit.log_likelihood not in seen:
            seen.add(e.fit.log_likelihood)
            found.append(e)
    return found


def _without_first(second: Explanation, baseline: Fit, records: Sequence[Record], limits: Limits) -> Fit:
    """The fit of a second effect without the one found before it (and its nuisance)."""
    both, own = second.fit, second.effect
    count = len(baseline.model.effects)
    first = both.model.effects[count]
    head = f"{first.location}.{first.effect}."
    fixed = tuple(name for name in both.model.fixed if not name.startswith(head))
    model = replace(both.model, effects=(*both.model.effects[:count], own), fixed=fixed)
    alone = fit_whole(model, both.noise, records, iterations=LAST_STEPS, limits=limits)
    return with_companion(alone, baseline.model, records, limits)
