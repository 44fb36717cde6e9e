"""Names, and what has none, at the place where something acts: parity equations say it without a name, and
so does a torque map that takes most of the error of free runs away."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from haptic_teleop_sim.effects import effect_entry
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.records import Record

from ...evidence.acting_place import ActingPlace
from ...evidence.inverse_dynamics.latent import INPUT
from ...evidence.inverse_dynamics.parity_equations import ENCODERS, JOINT, MOTOR
from ...evidence.inverse_dynamics.parity_signals import acts_at
from ...evidence.measured_map import MeasuredMap
from ...evidence.residual import Condition
from ...hypotheses.follows import follows_from_motion
from ...policy import HOLDS_BETTER, HOLDS_TOO, LEAST_EXPLAINED, MOST_UNNAMED, NEARLY_ALL
from ..reasons import Doubt
from ..search.decide import Choice
from ..search.rounds import SearchResult
from ..verdict import Verdict
from ..where import followed
from .beside_the_others import left_out, without


def misplaced(
    result: SearchResult, acting: ActingPlace, records: Sequence[Record]
) -> tuple[SearchResult, Doubt | None]:
    """The result without errors of encoders that are not in all equations of their angle, and without names
    at places where nothing acts, because what is missing acts at another one; ``records``: those of the
    estimation. The doubt that says so, where no name is left."""
    while (of_encoder := _of_encoder(result, acting)) is not None:
        result, doubt = _without(result, [of_encoder], records)
        if doubt is not None:
            return result, doubt
    return _without(result, _elsewhere(result, acting), records)


def _without(
    result: SearchResult, gone: Sequence[tuple[Choice, str]], records: Sequence[Record]
) -> tuple[SearchResult, Doubt | None]:
    """The result without some names, each with why; the doubt that says so, where no name is left."""
    if gone and len(gone) == len(result.choices):
        (first, why), *_ = gone
        return result.without_names([choice for choice, _ in gone], why), Doubt(first, why)
    for choice, why in gone:
        result = left_out(result, choice, why, without(result, choice.chosen.effect, records))
    return result, None


def _of_encoder(result: SearchResult, acting: ActingPlace) -> tuple[Choice, str] | None:
    """The first name of an encoder's error that is none, and why; the others are asked again without it."""
    for choice in result.choices:
        effect = choice.chosen.effect
        others = [c.chosen.effect for c in result.choices if c is not choice]
        place = acting.held_worse(effect, others)
        if place is not None:
            name, where = f"{effect.effect} at {effect.location}", result.baseline.model.location(place)
            return choice, (
                f"{name} is none: with readings that are corrected by it, the equation without what acts at "
                f"{where} holds worse, and an error of an encoder is in that, too"
            )
    return None


def _elsewhere(result: SearchResult, acting: ActingPlace) -> list[tuple[Choice, str]]:
    """Names at places where nothing acts, and why."""
    named = [c.chosen.effect for c in result.choices]
    asked = [
        c
        for c in result.choices
        if c.chosen.by_current <= 0.0 and not _changes_another(c.chosen.effect, named)
    ]
    if not asked:
        return []
    acting = acting.clear_beside(named)
    gone = [c for c in asked if acting.elsewhere(c.chosen.effect)]
    if not gone:
        return []
    where = " or ".join(map(result.baseline.model.location, acting.places))
    allowed = " and ".join(f"{e.effect} at {e.location}" for e in acting.beside)
    missing = f"all that is missing beside {allowed}" if allowed else "all that is missing"
    return [
        (
            c,
            f"{missing} acts at {where}, as the equations of the other places do not hold and its own does, "
            f"and {c.chosen.effect.effect} at {c.chosen.effect.location} does not make that hold better",
        )
        for c in gone
    ]


def _changes_another(effect: Effect, named: Sequence[Effect]) -> bool:
    """Whether an effect is the change of a friction that is named beside it: equations do not follow that."""
    frictions = [e.location for e in named if e.entry.kind == "friction"]
    return effect.entry.kind == "friction_factor" and effect.location in frictions


def at_its_place(
    verdict: Verdict, acting: ActingPlace, given_up: Effect | None = None
) -> tuple[Verdict, str | None]:
    """An `unknown` at the place whose parity equation holds, where it leaves less by HOLDS_BETTER than that
    of the place which was told, with the share (mean square) of this that it does not leave; and that place
    where it is an encoder, else None. Less by HOLDS_TOO is enough where the name that was ``given_up`` is of
    the same place, and that is no encoder. At the motor only where the other equation leaves more than passes
    for random. ``acting``: see `beside_findings`."""
    if verdict.kind != "unknown" or not verdict.where or not acting.bare:
        return verdict, None
    left, model = acting.bare, acting.model
    told, *others = verdict.where
    place = acts_at(model, told["equation"])
    best = min(left, key=lambda one: left[one])
    agreed = given_up is not None and acts_at(model, given_up.location) == best and best not in ENCODERS
    if place not in left or left[place] <= (HOLDS_TOO if agreed else HOLDS_BETTER) * left[best]:
        return verdict, None
    # Random torque at the motor spoils the other equations on every machine.
    if best == MOTOR and left[place] <= MOST_UNNAMED:
        return verdict, None
    share = round(1.0 - (left[best] / left[place]) ** 2, 3)
    where = {
        **told,
        "equation": model.location(best),
        "share": share,
        "condition": followed(_that_matter(verdict.remaining, best, model)),
    }
    return replace(verdict, where=[where, *others]), model.location(best) if best in ENCODERS else None


def at_the_map(verdict: Verdict, mapped: MeasuredMap, acting: ActingPlace | None) -> Verdict:
    """An `unknown` at the place of the torque map over the motion that takes most of the simulated error off
    recordings it was not drawn from, with what that depends on; not where the parity equation of another
    place holds better than all others, or better than that of the map's own place, unless the map explains
    NEARLY_ALL of the torque. ``acting``: see `beside_findings`, None where there are none."""
    if verdict.kind != "unknown" or not verdict.where or mapped.effect is None or INPUT in mapped.quantities:
        return verdict
    place, explained = mapped.effect.location, mapped.explained or 0.0
    if acting is not None and _elsewhere_by_equations(place, explained, acting):
        return verdict
    told, *others = verdict.where
    if place == told["equation"] or (mapped.closed or 0.0) < LEAST_EXPLAINED:
        return verdict
    where = {
        **told,
        "equation": place,
        "share": round(explained, 3),
        "condition": " and ".join(mapped.quantities),
        "intervals": [],
    }
    return replace(verdict, where=[where, *others])


def _elsewhere_by_equations(location: str, explained: float, acting: ActingPlace) -> bool:
    """Whether parity equations speak against the location of a map that explains a share of what is missing
    (see `at_the_map`)."""
    left, best = acting.bare, holds_better(acting)
    place = acts_at(acting.model, location)
    if best is not None or place not in left:
        return best not in (None, place)
    return left[place] > HOLDS_BETTER * min(left.values()) and explained < NEARLY_ALL


def _that_matter(remaining: Sequence[Condition], place: str, model: Model) -> list[Condition]:
    """Of what a left-over torque follows, what can matter at a place: an encoder's own motion, anything in
    the joint, and what the torque of that equation follows elsewhere."""
    body = place.split("_")[0]
    if place in ENCODERS:
        return [c for c in remaining if body in c.name]
    return [c for c in remaining if place == JOINT or c.equation == model.location(place)]


def beside_findings(verdict: Verdict, acting: ActingPlace) -> ActingPlace:
    """The equations beside the findings that are torques along the motion; and beside dry friction at the
    motor where nothing is said of friction there, and only so one of them holds better than all others."""
    found = [e for e in map(effect_of, verdict.findings) if follows_from_motion(e.entry)]
    acting = replace(acting, beside=(*acting.beside, *found))
    if acting.rubs(found) or holds_better(acting) is not None:
        return acting
    rubbed = replace(acting, beside=(*acting.beside, acting.dry_friction))
    return acting if holds_better(rubbed) is None else rubbed


def holds_better(acting: ActingPlace) -> str | None:
    """The place whose equation leaves less by HOLDS_BETTER than all others."""
    ordered = sorted(acting.bare, key=lambda place: acting.bare[place])
    if len(ordered) < 2 or acting.bare[ordered[1]] <= HOLDS_BETTER * acting.bare[ordered[0]]:
        return None
    return ordered[0]


def effect_of(finding: Mapping[str, Any]) -> Effect:
    """The effect of a finding; what was not told of it is as it is by default."""
    entry, told = effect_entry(finding["effect"]), finding["parameters"]
    values = {p.name: 0.0 if p.default is None else p.default for p in entry.parameters}
    values |= {name: one["value"] for name, one in told.items()}
    return Effect(finding["effect"], finding["location"], values)
