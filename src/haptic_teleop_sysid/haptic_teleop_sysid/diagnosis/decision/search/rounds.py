"""The whole search: baseline, then one effect after another until nothing more stands up."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.records import Record

from ...evidence.actuator import joined
from ...evidence.inverse_dynamics.late_channels import late_channels
from ...evidence.inverse_dynamics.searched_groups import SearchedGroups
from ...evidence.isolable import nats_apart
from ...evidence.shown_by_current import Shown
from ...hypotheses.explanation import Explanation
from ...hypotheses.twins import with_twins
from ...inputs.scales import Scales, recording_scales, within_reach
from .decide import Choice, choose
from .explore import explore
from .fitted_further import fitted_further
from .plainer_form import told_plainly
from .two_names import two_names
from .without_the_first import without_the_first

#: Effects that are looked for one after another.
MOST_EFFECTS = 3


@dataclass(frozen=True)
class GivenUp:
    """What was found and is not believed, and ``why``."""

    found: Explanation
    why: str


@dataclass(frozen=True)
class SearchResult:
    """``baseline``: the given structure re-estimated; ``final``: with all chosen effects; ``choices``: one
    per effect found; ``last_round``: what was tried after the last choice and did not stand up; ``nameless``:
    what explains the recordings (or what the choices leave) better than anything that has a name;
    ``given_up``: what was found and is not believed; ``by_torque``: ``final`` with the sizes that the torques
    want, where its own are those that free runs want; ``searched``: whose names these are, None where they
    are the search's own; ``settled``: parameters of the structure for which all of ``final`` is fitted to
    both kinds of recordings (see `Group`).
    """

    baseline: Fit
    final: Fit
    choices: tuple[Choice, ...]
    last_round: tuple[Explanation, ...]
    scales: Scales
    nameless: Choice | None = None
    given_up: tuple[GivenUp, ...] = ()
    by_torque: Fit | None = None
    searched: SearchedGroups | None = None
    settled: tuple[str, ...] = ()

    def giving_up(self, choices: Sequence[Choice], why: str) -> SearchResult:
        """The result, in which some of its choices are told as given up."""
        return replace(self, given_up=(*self.given_up, *(GivenUp(c.chosen, why) for c in choices)))

    def without_companions(self) -> SearchResult:
        """The result without names of what goes with another one's: the damping of the joint with a gap whose
        faces damp. The model keeps it."""
        with_them = {c.chosen.effect.entry.companion for c in self.choices}
        kept = (
            c
            for c in self.choices
            if not (c.chosen.effect.effect in with_them and c.chosen.effect.location.endswith("_joint"))
        )
        return replace(self, choices=tuple(kept))

    def without_names(self, choices: Sequence[Choice], why: str) -> SearchResult:
        """The structure alone, with some of the choices told as given up."""
        told = self.giving_up(choices, why)
        return replace(told, final=self.baseline, choices=(), last_round=(), nameless=None, settled=())


def search(
    model: Model,
    baseline: Fit,
    estimation: Sequence[Record],
    validation: Sequence[Record],
    *,
    sense_follows: bool = False,
    shown: Sequence[Shown] = (),
    percent: Callable[[Model], float] | None = None,
    progress: Callable[[str], None] | None = None,
) -> SearchResult:
    """Find the effects that the model, re-estimated as ``baseline``, lacks on the estimation recordings and
    that stand up on the validation ones. ``shown``: what the measured currents say; ``percent``: simulated
    fit of a model, see `choose`.
    """
    say = progress or (lambda text: None)
    scales = recording_scales(baseline.model, estimation)
    fit, choices, strongest, nameless = baseline, [], 0.0, None
    found: list[Explanation] = []
    apart = partial(nats_apart, records=(*estimation, *validation))
    pick = partial(choose, sense_follows=sense_follows, percent=percent, apart=apart)

    def lab_with_effects_of(fit: Fit) -> Model:
        return replace(model, effects=fit.model.effects, fixed=fit.model.fixed)

    shifted = late_channels(model, estimation)

    def explored(fit: Fit, number: int) -> tuple[Fit, list[Explanation]]:
        tell = lambda text: say(f"effect {number}: {text}")  # noqa: E731
        lab = lab_with_effects_of(fit)
        return explore(fit, lab, estimation, validation, scales, tell, shifted=shifted, further=number > 1)

    # A second effect can take the first one's place, two names can come at once.
    for _ in range(MOST_EFFECTS):
        number = len(choices) + 1
        if number > MOST_EFFECTS:
            break
        limits = within_reach(lab_with_effects_of(fit), scales)
        fit, found = explored(fit, number)
        if number == 1:
            baseline = fit
        else:
            choices = fitted_further(choices, baseline, fit, estimation, validation, scales)
            strongest = max(strongest, choices[-1].chosen.by_motion)
        if shown and not any(c.chosen.by_current > 0.0 for c in choices):
            found = joined(fit, model, found, shown, estimation, validation, scales, limits)
        found = with_twins(found)
        choice = pick(found, strongest, further=bool(choices))
        if choice is None:
            break
        more = [choice]
        if choice.unnamed:
            beside = lambda one: with_twins(explored(one, 2)[1])  # noqa: E731
            more = [] if choices else two_names(choice, found, beside, pick)
        if not more:
            nameless = choice
            break
        choices += more
        choice = choices[-1]
        fit = choice.chosen.fit
        if more == [choice] and len(choices) == 2 and all(c.chosen.by_current <= 0.0 for c in choices):
            second = without_the_first(baseline, choice, estimation, validation, scales, limits)
            alone = pick(second, 0.0) if second else None
            if alone is not None and not alone.unnamed:
                choices, fit = [alone], alone.chosen.fit
        strongest = max(strongest, *(c.chosen.by_motion for c in more))
    plainly = told_plainly(choices, estimation, within_reach(model, scales))
    if plainly != choices:
        choices, fit = plainly, plainly[-1].chosen.fit
    shown_too = any(c.chosen.by_current > 0.0 for c in choices)
    if nameless is not None and not shown_too and nameless.chosen.by_motion > strongest:
        # What came first was the nearest name of something else.
        choices, fit = [], baseline
    return SearchResult(baseline, fit, tuple(choices), tuple(found), scales, nameless)
