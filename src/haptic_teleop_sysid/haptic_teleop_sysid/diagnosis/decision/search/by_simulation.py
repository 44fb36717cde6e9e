"""The search where recordings can only be told apart by running freely: short, or of a noisy torque."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.prediction_fit import fit_parameters
from haptic_teleop_sysid.estimation.records import Record

from ...evidence.simulated import explore_simulated, simulation_noise
from ...hypotheses.candidates import family
from ...hypotheses.explanation import Explanation
from ...inputs.scales import recording_scales, within_reach
from .decide import Choice
from .rounds import MOST_EFFECTS, SearchResult

#: Simulated fit (percent) of the model with the findings that are kept, below which this search is tried.
POOR_FIT = 75.0
#: Least improvement of the simulated fit, percent, estimation and validation added up, for an effect
#: found so.
LEAST_PERCENT = 6.0


def search_by_simulation(
    model: Model,
    predicted: Fit,
    estimation: Sequence[Record],
    validation: Sequence[Record],
    *,
    percent: Callable[[Model], tuple[float, float]],
    progress: Callable[[str], None],
) -> SearchResult:
    """The search with an observer that hardly corrects, the same for all models.

    Short recordings of a machine whose torque was itself measured with much noise can be followed by almost
    any model that is corrected at every sample; how they differ shows when they have to run freely.
    ``percent`` gives the simulated fit of a model on both kinds of recordings: an effect is taken when it
    helps on both and by ``LEAST_PERCENT`` in all.
    """
    noise = simulation_noise(predicted, estimation)
    scales = recording_scales(predicted.model, estimation)
    progress("re-estimating the given structure, freely running")
    fit = baseline = fit_parameters(
        model, noise, estimation, iterations=40, limits=within_reach(model, scales)
    )
    choices: list[Choice] = []
    found: list[Explanation] = []
    before = percent(baseline.model)
    for number in range(MOST_EFFECTS):
        lab = replace(model, effects=fit.model.effects, fixed=fit.model.fixed)
        found = explore_simulated(
            fit,
            lab,
            estimation,
            validation,
            scales,
            lambda text, n=number: progress(f"effect {n + 1}, freely running: {text}"),
        )
        good = []
        for e in found[:10]:
            after = percent(e.fit.model)
            better = (after[0] - before[0], after[1] - before[1])
            # What helps a run over the whole recording and speaks against every stretch of it is luck.
            likelier = e.gain > 0.0 and e.held_out > 0.0
            if e.material and likelier and min(better) > -1.0 and sum(better) > LEAST_PERCENT / 2:
                good.append((sum(better), e, after))
        if not good or max(g[0] for g in good) < LEAST_PERCENT:
            break
        good.sort(key=lambda g: -g[0])
        most = good[0][0]
        # As good within a tenth of the improvement: not to be told apart by these recordings. Of forms of one
        # thing the simpler is taken unless it does clearly less.
        forms = family(good[0][1].effect.effect)
        close = [g for g in good if g[0] > (0.4 if g[1].effect.effect in forms else 0.9) * most]
        simplest = min(close, key=lambda g: (len(g[1].effect.parameters), -g[0]))
        rivals = tuple((g[1], round(0.5 / len(close), 4)) for g in close if g is not simplest)
        choices.append(Choice(simplest[1], 1.0 - sum(p for _, p in rivals), rivals))
        fit, before = simplest[1].fit, simplest[2]
    return SearchResult(baseline, fit, tuple(choices), tuple(found), scales)
