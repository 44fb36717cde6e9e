"""The second method's answer as a result like any other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.records import Record

from ...evidence.inverse_dynamics.searched_groups import Group
from ...evidence.second_method import Errors, SecondMethod
from ...hypotheses.explanation import Explanation
from ...hypotheses.twins import twins
from ...policy import LEAST_EXPLAINED
from ..reasons import Doubt
from ..search.decide import LEAST_TOLD, Choice, prior
from ..search.rounds import SearchResult
from .free_run_sizes import Simulated, as_fitted, sized_freely
from .known_sizes import with_known_sizes


def as_result(
    second_method: SecondMethod,
    predicted: SearchResult,
    records: Sequence[Record],
    errors: Errors,
    simulated: Simulated,
) -> tuple[SearchResult, Doubt | None]:
    """The second method's answer as a search's result, and the doubt where its name explains too little;
    ``errors``, ``simulated``: see `free_run_sizes`."""
    assert second_method.chosen is not None
    # The sizes are those of runs as long as the reported ones.
    judged = replace(second_method.chosen, errors=errors(second_method.chosen.group.model))
    fastest = predicted.scales.size["fastest"]
    second_method = with_known_sizes(
        replace(second_method, chosen=judged), lambda h: sized_freely(h, simulated, errors, fastest), errors
    )
    assert second_method.chosen is not None
    baseline = predicted.baseline
    alone = second_method.searched.structure
    if errors(alone.model)[0] < errors(baseline.model)[0]:
        baseline = fit_of(alone, baseline, records)
    group = second_method.chosen.group
    final = fit_of(group, baseline, records)
    sized = len(group.effects) == len(judged.group.effects) and group is not judged.group
    other = fit_of(judged.group, baseline, records) if sized else None
    adequacy = second_method.adequacy
    choices = tuple(
        _choice(second_method, final, len(group.model.effects) - len(group.effects) + i)
        for i in range(len(group.effects))
    )
    if adequacy < LEAST_EXPLAINED:
        search = second_method.searched.folds
        shapes = {n for h in group.hypotheses for latent in search.alike(h) for n in latent.quantities}
        names = " and ".join(f"{e.effect} at {e.location}" for e in group.effects)
        why = (
            f"the most similar effect, {names}, explains {100 * adequacy:.0f} % of what a torque without a "
            f"form explains in the same quantities ({', '.join(sorted(shapes))})"
        )
        bare = replace(predicted, baseline=baseline, final=baseline, choices=(), last_round=(), nameless=None)
        return bare, Doubt(choices[0], why, " and ".join(sorted(shapes)) or None, short=True)
    named = replace(predicted, baseline=baseline, final=final, choices=choices, by_torque=other)
    named = replace(named, settled=group.settled)
    return replace(named, last_round=(), nameless=None, searched=second_method.searched), None


def fit_of(group: Group, like: Fit, records: Sequence[Record]) -> Fit:
    """The group's model as it is, with noise levels for its observer and the regression's standard errors."""
    return replace(as_fitted(group.model, group.std, like, records), at_bound=group.at_bound)


def _choice(second_method: SecondMethod, final: Fit, index: int) -> Choice:
    """One effect of the chosen group, with its share of what is believed, and what else it may be."""
    chosen, effect = second_method.chosen, final.model.effects[index]
    assert chosen is not None
    own, others = 0.0, dict[tuple[str, str], tuple[Effect, float]]()
    known = {(e.effect, e.location) for e in chosen.group.effects}
    for judged, weight in second_method.rivals:
        if any((e.effect, e.location) == (effect.effect, effect.location) for e in judged.group.effects):
            own += weight
            continue
        for e in judged.group.effects:
            if (e.effect, e.location) not in known:
                before = others.get((e.effect, e.location), (e, 0.0))[1]
                others[e.effect, e.location] = (e, before + weight)
    # One and the same to these recordings.
    there = {(e.effect, e.location) for e in final.model.effects}
    same = [e for e in twins(effect, final.model.rigid) if (e.effect, e.location) not in {*others, *there}]
    likely = [prior(e.effect, e.location, False) for e in same]
    own /= 1.0 + sum(likely)
    for e, share in zip(same, likely, strict=True):
        others[e.effect, e.location] = (e, own * share)
    told = (
        f"of the torque that the motion asks for and the structure does not have, it explains "
        f"{100 * chosen.group.explained:.0f} % on recordings that were not fitted"
        if len(known) == 1
        else f"together they explain {100 * chosen.group.explained:.0f} % of the torque that the motion asks "
        "for and the structure does not have, on recordings that were not fitted"
    )
    told += f", and a free run errs by {100 * chosen.errors[1]:.1f} % of the motion there"
    explanation = Explanation(final, chosen.gain, 0.0, True, index, grounds=told)

    def instead(other: Effect) -> Explanation:
        effects = (*final.model.effects[:index], other, *final.model.effects[index + 1 :])
        return replace(explanation, fit=replace(final, model=replace(final.model, effects=effects)))

    rivals = sorted(others.values(), key=lambda o: -o[1])
    return Choice(explanation, own, tuple((instead(e), p) for e, p in rivals if p > LEAST_TOLD))
