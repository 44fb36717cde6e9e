"""Both methods on what is missing: baseline and search by one-step prediction, and the inverse dynamics."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.first_state import from_first_state
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import FAILURES
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch
from haptic_teleop_sysid.recordings.dataset import DataSet
from haptic_teleop_sysid.simulation.parameter_fit import ParameterFit, fit_output_error
from haptic_teleop_sysid.simulation.windows import fewer

from .decision.coloured import coloured
from .decision.search.by_simulation import POOR_FIT, search_by_simulation
from .decision.search.decide import Choice
from .decision.search.rounds import SearchResult, search
from .decision.second_method.free_run_sizes import freely_sized, turning_limits
from .decision.second_method.overruled import errs_enough_less
from .evidence.horizons import Horizons, free_errors
from .evidence.inverse_dynamics.band import motion_band
from .evidence.inverse_dynamics.group_search import search_groups
from .evidence.predictable import while_followed, while_predictable
from .evidence.proof import Course
from .evidence.second_method import SecondMethod, fitted_to_both, judge_groups
from .evidence.shown_by_current import shown_by_current
from .inputs.scales import recording_scales, within_reach
from .policy import HARM
from .usable import records_of, sense_follows

#: Windows over which parameters are fitted to free runs: an unstable machine is followed over short ones.
MOST_WINDOWS = 200


@dataclass(frozen=True)
class Explained:
    """What the search makes of recordings, before chance and doubt: the ``given`` model; the records of both
    kinds of recordings (``learn``, ``judge``), ``course`` of all data sets, and ``horizons``: the same,
    thinned, over stretches of several lengths, where models are compared; ``result`` of the search by
    prediction, ``kept``: that without what harms, or what only the search by simulation found (``freely``);
    ``second_method``: the second one, None where the arithmetic of the inverse dynamics failed; ``cutoff``:
    Hz, of the band of the motion."""

    given: Model
    learn: list[Record]
    judge: list[Record]
    course: Course
    horizons: Horizons
    result: SearchResult
    kept: SearchResult
    freely: bool
    second_method: SecondMethod | None
    cutoff: float

    @property
    def coarse(self) -> Course:
        """`course`, thinned."""
        return self.horizons.courses[0]

    @property
    def count(self) -> int:
        """Of the recordings of `course` the first so many are the estimation's."""
        return self.horizons.count

    @property
    def inertias(self) -> list[float]:
        """What else is known of the motor's inertia, kg·m²: as it is believed, and as the inverse dynamics of
        slow motion have it."""
        slow = [] if self.second_method is None else [self.second_method.searched.structure.model]
        return [one.parameters["motor_inertia"] for one in (self.given, *slow)]

    def chosen_by(self, candidate: Model) -> tuple[float, float]:
        """Simulated fit of a model on the validation recordings, percent: of all signals, of velocities."""
        every, speeds = (self.coarse.percent(candidate, kind)[self.count :] for kind in ("", "velocity"))
        return float(np.mean(every)), float(np.mean(speeds))

    def errors(self, candidate: Model) -> tuple[float, float]:
        """Errors of the model's free runs over the windows of `course` (see `evidence.horizons`)."""
        return free_errors(self.coarse, self.count, candidate)

    def nearby(self, candidate: Model) -> list[dict[str, NDArray[np.float64]]]:
        """The simulated signals, by name, of each validation recording, over stretches so short that they
        stay where the joint was."""
        return [fit.simulated for fit in self.horizons.shortest.simulate(candidate)[self.count :]]

    def simulated(self, candidate: Model) -> ParameterFit:
        """The model fitted to free runs of the estimation recordings, over MOST_WINDOWS windows of `course`
        at most: each has an initial state that is sought, too, and time grows with the third power of their
        number."""
        windows = fewer(self.course.windows[: self.count], MOST_WINDOWS)
        scales = self.result.scales
        limits = within_reach(self.given, scales) | turning_limits(candidate, scales.size["fastest"])
        parts = [*zip(self.course.data[: self.count], windows, strict=True)]
        return fit_output_error(candidate, parts, limits)

    def resized(self, fit: Fit) -> Fit | None:
        """A fit with the parameters that its free runs want (see `freely_sized`)."""
        return freely_sized(fit, self.simulated, self.learn, self.result.scales.size["fastest"])


def explain(
    model: Model, estimation: list[DataSet], validation: list[DataSet], say: Callable[[str], None]
) -> Explained:
    """Baseline and search, on recordings and on simulated ones alike."""
    n, everything = len(estimation), [*estimation, *validation]
    learn, judge = records_of(estimation), records_of(validation)
    say("re-estimating the given structure")
    limits = within_reach(model, recording_scales(model, learn))
    baseline = fit_from_scratch(model, learn, limits=limits)
    if not np.isfinite(baseline.log_likelihood):
        raise RecordingError(
            f"{model.source} predicts nothing of {estimation[0].name}, whatever its parameters: see whether "
            "its inertias, and the units and signs of the recording, are what they should be."
        )
    judge = from_first_state(baseline, judge)
    if (begun := from_first_state(baseline, learn)) is not learn:
        learn = begun
        baseline = fit_from_scratch(model, learn, limits=limits)
    cutoff = motion_band([*learn, *judge])
    say("asking the inverse dynamics")
    try:
        said = search_groups(model, learn, judge, recording_scales(baseline.model, learn), cutoff)
    except FAILURES:
        said = None
    course = Course.of(baseline.model, everything)
    if said is not None and said.most_likely is not None:
        course = while_predictable(course, said.most_likely.model)
        course = while_followed(course, n, said.most_likely, cutoff)
    coarse = course.coarse(cutoff)
    result = search(
        model,
        baseline,
        learn,
        judge,
        sense_follows=sense_follows(estimation),
        shown=shown_by_current(model, estimation, validation),
        percent=lambda candidate: float(np.mean(coarse.percent(candidate))),
        progress=say,
    )

    def percent(candidate: Model) -> tuple[float, float]:
        fits = coarse.percent(candidate, "position")
        return float(np.mean(fits[:n])), float(np.mean(fits[n:]))

    horizons = Horizons.of(coarse, n, cutoff)
    kept = unharmful(result, horizons.percent)
    freely = False
    poor = min(percent(kept.final.model)) < POOR_FIT or (result.choices and not kept.choices)
    if poor and result.nameless is None:
        say("searching by free simulation")
        free = search_by_simulation(model, result.baseline, learn, judge, percent=percent, progress=say)
        if free.choices and (not kept.choices or _errs_less(free.final, kept.final, horizons, learn, judge)):
            better = "what a search by free simulation finds simulates all recordings better"
            kept = replace(free, given_up=kept.giving_up(kept.choices, better).given_up)
            freely = True
    second_method = None
    if said is not None:
        alone = (model, result.baseline.model, fitted_to_both(said, said.structure, horizons.errors).model)
        with suppress(*FAILURES):
            second_method = judge_groups(
                said, result.scales, horizons.errors, min(map(horizons.errors, alone))
            )
    return Explained(model, learn, judge, course, horizons, result, kept, freely, second_method, cutoff)


def _errs_less(
    free: Fit, kept: Fit, horizons: Horizons, learn: Sequence[Record], judge: Sequence[Record]
) -> bool:
    """Whether what free runs say is missing takes the place of what predictions say (`errs_enough_less`)."""
    one, first = horizons.errors(free.model), horizons.errors(kept.model)
    return errs_enough_less(one, first, lambda: coloured(kept, learn, judge))


def unharmful(result: SearchResult, percent: Callable[[Model], tuple[float, float]]) -> SearchResult:
    """The search's result without the last effects while those spoil the free simulation of either kind of
    recordings (``percent``, see `Horizons.percent`): what predicts the next sample better but runs away when
    it runs freely is no explanation."""
    kept = list(result.choices)
    before = percent(result.baseline.model)

    def spoiled(choice: Choice) -> bool:
        return any(a < b - HARM for a, b in zip(percent(choice.chosen.fit.model), before, strict=True))

    while kept and spoiled(kept[-1]):
        kept.pop()
    if len(kept) == len(result.choices):
        return result
    final = kept[-1].chosen.fit if kept else result.baseline
    spoils = "with it recordings are simulated worse"
    result = result.giving_up(result.choices[len(kept) :], spoils)
    return replace(result, choices=tuple(kept), final=final, last_round=())
