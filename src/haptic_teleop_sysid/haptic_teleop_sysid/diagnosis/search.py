"""The whole search: baseline, then one effect after another until nothing more stands up."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.gauss_newton import Fit
from haptic_teleop_sysid.estimation.joint_fit import fit_model
from haptic_teleop_sysid.estimation.records import Record

from .decide import Choice, choose
from .explore import Explanation, explore
from .scales import Scales, recording_scales

#: Effects that are looked for one after another.
MOST_EFFECTS = 3


@dataclass(frozen=True)
class SearchResult:
    """``baseline``: the given structure re-estimated; ``final``: with all chosen effects; ``choices``: one per effect
    found; ``last_round``: what was tried after the last choice and did not stand up."""

    baseline: Fit
    final: Fit
    choices: tuple[Choice, ...]
    last_round: tuple[Explanation, ...]
    scales: Scales


def search(model: Model, estimation: Sequence[Record], validation: Sequence[Record], *, sense_follows: bool = False,
           progress: Callable[[str], None] | None = None) -> SearchResult:
    """Find the effects that the model lacks on the estimation recordings and that stand up on the validation ones."""
    say = progress or (lambda text: None)
    say("re-estimating the given structure")
    baseline = fit_model(model, estimation)
    scales = recording_scales(baseline.model, estimation)
    fit, choices, strongest = baseline, [], 0.0
    found: list[Explanation] = []
    for number in range(MOST_EFFECTS):
        lab = replace(model, effects=fit.model.effects)
        found = explore(fit, lab, estimation, validation, scales,
                        lambda text, n=number: say(f"effect {n + 1}: {text}"))
        choice = choose(found, strongest, sense_follows)
        if choice is None:
            break
        choices.append(choice)
        fit = choice.chosen.fit
        strongest = max(strongest, choice.chosen.score)
    return SearchResult(baseline, fit, tuple(choices), tuple(found), scales)
