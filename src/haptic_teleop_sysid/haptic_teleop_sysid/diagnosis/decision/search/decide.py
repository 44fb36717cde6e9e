"""From explanations to a verdict: how sure, which others fit as well, and when to say nothing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from haptic_teleop_sim.effects import effect_entry
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.fit import Fit

from ...evidence.certainty import parameter_covariance, standard_errors
from ...hypotheses.candidates import family
from ...hypotheses.enough import gains_enough
from ...hypotheses.explanation import Explanation
from ...policy import (
    CLEARLY_LESS,
    LEAST_SHARE,
    LEAST_SHARE_ALIKE,
    LEAST_SHARE_EXOGENOUS,
    SIGNIFICANT,
    SURE,
)
from .rivals import alike, margin, needlessly_rich

#: Share of the best name's score by which every name must fall behind physics that has none, beside
#: CLEARLY_LESS.
SHARE_LESS = 0.05
#: Percent of simulated fit that a rival may be worse before its weight falls to a third.
SIMULATED_MARGIN = 4.0
#: Weight, relative to the best explanation, of one that the recordings cannot tell from it.
ALIKE = 0.5
#: Share of the weights from which another name is told beside the chosen one.
LEAST_TOLD = 0.02


@dataclass(frozen=True)
class Choice:
    """What one round of the search found: the chosen explanation, its confidence, and the others that remain
    possible with theirs.  ``alike``: confidence of those among them that are behind, but predict hardly
    anything else. ``unsure``: why nobody may be sure of it whatever its confidence here, in words.
    """

    chosen: Explanation
    confidence: float
    others: tuple[tuple[Explanation, float], ...] = field(default=())
    alike: float = 0.0
    unsure: str = ""

    @property
    def unnamed(self) -> bool:
        """Whether what explains the recordings best has no name in the table of effects."""
        return self.chosen.effect.entry.unnamed

    @property
    def ambiguous(self) -> bool:
        return self.confidence < SURE and bool(self.others)

    @property
    def left_open(self) -> bool:
        """Whether the likelihoods themselves leave open what it is, be it told from what is alike or not."""
        return self.ambiguous and self.confidence < SURE * (1.0 - self.alike)


def choose(
    found: Sequence[Explanation],
    best_so_far: float,
    sense_follows: bool,
    percent: Callable[[Model], float] | None = None,
    apart: Callable[[Fit, Fit], float] | None = None,
    further: bool = False,
) -> Choice | None:
    """The best explanation that is material and gains enough on both kinds of recordings; None if there is
    none.

    ``best_so_far``: score of the strongest effect found before (0 in the first round).  ``sense_follows``:
    the measured current follows the command without extra delay, so that a command stamped early is unlikely.
    ``percent``: simulated fit of a model, which tells rivals apart that predict the next sample alike.
    ``apart``: nats at which the recordings tell one fit from another (see `isolable.nats_apart`).
    ``further``: others were found before.
    """
    gaining = [e for e in found if may_be_chosen(e, further)]
    good: list[Explanation] = []
    leftovers: list[Explanation] = []
    for e in gaining:
        shares = e.by_current > 0.0 or e.score >= _least_share(e) * best_so_far
        (good if shares else leftovers).append(e)
    if apart is not None:
        # What predicts the same as a leftover is one, whatever its name.
        left = [e for e in leftovers if not e.effect.entry.unnamed]
        good = [e for e in good if e.by_current > 0.0 or not any(alike(one, e, apart) for one in left)]
    # One effect by the motion alone and by the currents as well is one explanation, not two.
    best_of = {(e.effect.effect, e.effect.location): e for e in sorted(good, key=lambda e: e.score)}
    good = [e for e in good if e is best_of[e.effect.effect, e.effect.location]]
    if not good:
        return None
    named = [e for e in good if not e.effect.entry.unnamed]
    best = max(good, key=lambda e: e.score)
    if best.effect.entry.unnamed:
        # A name has to lose clearly before it is not given; beside an effect that is found already, be its
        # own size known well or not.
        rivals = named if best_so_far <= 0.0 else [e for e in found if e.material]
        nearest = max((e.score for e in rivals if not e.effect.entry.unnamed), default=0.0)
        if best.score > nearest + max(CLEARLY_LESS, SHARE_LESS * nearest) and best.score > (
            LEAST_SHARE_ALIKE * best_so_far
        ):
            return Choice(best, 1.0)
    if not named:
        return None
    good, best = named, max(named, key=lambda e: e.score)
    margins = [(best.score - e.score) / margin(best, e) for e in good]
    near = [(e, m) for e, m in zip(good, margins, strict=True) if m < 3.0 and not needlessly_rich(e, good)]
    close, behind = [e for e, _ in near], np.array([m for _, m in near])
    # What lies a whole margin behind is hardly a rival, unless it makes hardly another prediction.
    weights = np.exp(-behind) * np.where(behind > 1.0, 0.2, 1.0)
    raised = np.zeros(len(close), dtype=np.bool_)
    if apart is not None:
        raised = np.array([alike(e, best, apart) for e in close]) & (weights < ALIKE)
        weights[raised] = ALIKE
    names = [(e.effect.effect, e.effect.location) for e in close]
    weights = weights * [
        1.0 if e.beside is not None else prior(*name, sense_follows)
        for e, name in zip(close, names, strict=True)
    ]
    if percent is not None and len(close) > 1:
        fits = np.array([percent(e.fit.model) for e in close])
        weights = weights * np.exp((fits - fits.max()) / SIMULATED_MARGIN)
    weights = weights / weights.sum()
    order = np.argsort(-weights, kind="stable")
    ranked = [(close[i], float(weights[i])) for i in order]
    others = tuple((e, p) for e, p in ranked[1:] if p > LEAST_TOLD)
    first = int(order[0])
    little = float(np.sum(weights[raised])) if not raised[first] else 0.0
    choice = Choice(ranked[0][0], ranked[0][1], others, little)
    if (
        choice.left_open
        and not _forms_of_one_thing(choice)
        and choice.chosen.by_current <= 0.0
        and choice.chosen.score < LEAST_SHARE_ALIKE * best_so_far
    ):
        return None
    return choice


def may_be_chosen(explanation: Explanation, further: bool) -> bool:
    """Whether an explanation is material and gains enough on both kinds of recordings by a size that differs
    from none; ``further``: others were found before."""
    e = explanation
    return e.material and gains_enough(e.gain, e.elsewhere, alone=not further) and significant(e)


def _forms_of_one_thing(choice: Choice) -> bool:
    """Whether only the form is in doubt (a spring or gravity over a small angle), not what and where."""
    chosen, forms = choice.chosen.effect, family(choice.chosen.effect.effect)
    return all(e.effect.location == chosen.location and e.effect.effect in forms for e, _ in choice.others)


def _least_share(explanation: Explanation) -> float:
    """Leftovers of a slightly wrong form go to what is of its kind at its place first; between command and
    torque, and in an encoder, to whatever is there."""
    own = explanation.effect
    if own.entry.exogenous:
        return LEAST_SHARE_EXOGENOUS
    alike = any(
        e.location == own.location
        and (e.entry.kind == own.entry.kind or not own.location.endswith(("_motor", "_arm", "_joint")))
        for e in explanation.fit.model.effects[: explanation.effect_index]
    )
    return LEAST_SHARE_ALIKE if alike else LEAST_SHARE


def prior(effect: str, location: str, sense_follows: bool) -> float:
    """How likely an effect is before looking, by its entry; ``sense_follows``: whether the measured current
    follows the command."""
    own = effect_entry(effect).prior
    return 1.0 if own is None else own(location.rpartition("_")[2], sense_follows)


def significant(explanation: Explanation) -> bool:
    """Whether the effect's size differs from none by more than its uncertainty (Wald test of all its sizes).

    Its shape stays as it was found: without the effect it has none, and of a slow drift neither the change
    nor the time constant is known although their ratio is. The structure's parameters are projected out. A
    factor differs from nought as well: an input of which nothing arrives is not what drives the joint.
    """
    effect, fit = explanation.effect, explanation.fit
    head = f"{effect.location}.{effect.effect}."
    errors = standard_errors(fit) | explanation.std
    factors = [p.name for p in effect.entry.parameters if p.neutral and np.isfinite(p.neutral)]
    if any(not abs(effect.values[n]) > SIGNIFICANT * errors.get(head + n, 0.0) for n in factors):
        return False
    away = {
        head + p.name: effect.values[p.name] - p.neutral
        for p in effect.entry.parameters
        if p.default is None and p.neutral is not None
    }
    if not away:
        return True
    if not np.all(np.isfinite(fit.information)):
        return False
    for name, size in away.items():
        # What the currents determined, what no fit was free to change, and a limit where there is none.
        error = explanation.std.get(name, None if name in fit.free and np.isfinite(size) else 0.0)
        if error is not None and abs(size) > SIGNIFICANT * error:
            return True
    shape = [n for n in fit.free if n.startswith(head) and n not in away]
    names, scale, inverse = parameter_covariance(fit, shape)
    tested = [i for i, n in enumerate(names) if n in away]
    if not tested:
        return False
    apart = np.array([away[names[i]] for i in tested]) * scale[tested]
    return bool(
        apart @ np.linalg.pinv(inverse[np.ix_(tested, tested)], hermitian=True) @ apart > SIGNIFICANT**2
    )
