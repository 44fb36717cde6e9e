"""The content of diagnosis.json: the keys that others rely on, and what docs/file_formats.md lists beside
them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import after_settling
from haptic_teleop_sysid.estimation.records import Record

from ..decision.adequacy import OVERFLOWS
from ..decision.reasons import Doubt, slipped
from ..decision.search.decide import Choice, significant
from ..decision.search.nulls import Null
from ..decision.search.rounds import GivenUp, SearchResult
from ..decision.stand import Stand
from ..decision.verdict import Verdict
from ..decision.where import FOLLOWS
from ..evidence.proof import PARTS, Proof
from ..evidence.residual import left_over
from ..evidence.whiteness import LAGS
from ..hypotheses.explanation import Explanation
from ..inputs.uses import Uses
from .belonging import apart
from .beside_given import beside_given
from .columns import Number, moved
from .next_experiment import next_experiment

#: How many of the explanations that did not stand up are told.
_MOST_TRIED = 10


def contents(
    result: SearchResult,
    verdict: Verdict,
    proof: Proof,
    columns: Mapping[str, Mapping[str, Number]],
    stand: Stand,
    doubt: Doubt | None,
    chance: tuple[Sequence[Null], Sequence[Choice]],
    uses: Uses,
    records: Sequence[Record],
    has: str = "what was found",
) -> dict[str, Any]:
    """Everything but run time and version; ``columns``: the numbers of the proof's models; ``records``: those
    of the estimation recordings; ``chance``: what was found where nothing is hidden, and the findings that
    did not exceed it; ``has``: what the augmented model has, in words."""
    model = result.baseline.model
    content = {
        "schema": 1,
        "robot": model.robot,
        "joint": model.joint,
        "structure": model.structure,
        "verdict": verdict.kind,
        "where": verdict.where,
        "findings": verdict.findings,
        "fit": proof.content(),
        "models": {
            name: {"parameters": {n: number.content() for n, number in numbers.items()}}
            for name, numbers in columns.items()
        },
        **beside_given(proof, has),
        "parameters_moved": [],
        "left_over": _follows(verdict),
        "adequacy": None if verdict.adequacy is None else verdict.adequacy.content(),
        "uses": {part: [d.name for d in proof.parts[part]] for part in PARTS} | {"what": uses.told},
        "recordings": uses.problems,
        "recordings_apart": apart(proof),
        "next_experiment": next_experiment(result, verdict, records),
        "baseline_parameters": result.baseline.model.parameter_values(),
        "innovations": {
            "what": f"portmanteau statistic over {LAGS} lags, {LAGS} on average for white innovations",
            "baseline": dict(zip(("estimation", "validation"), stand.before, strict=True)),
            "augmented": dict(zip(("estimation", "validation"), stand.after, strict=True)),
        },
    }
    added = {
        "baseline": disturbance(result, result.baseline, records),
        "augmented": disturbance(result, result.final, records),
    }
    content["disturbance"] = {
        "what": "rms torque that the observer adds at motor and arm, relative to the rms input torque",
        **added,
    }
    if (overflow := overflows(added)) is not None:
        content["disturbance"]["overflow"] = overflow
    # What moved where something unknown is missing made up for it, and what simulates worse is no better
    # estimate.
    if verdict.kind != "unknown" and content["augmented_model"]["holds"] != "given":
        content["parameters_moved"] = moved(proof.models["given"], columns["augmented"])
    content["tried"] = [
        {
            "effect": e.effect.effect,
            "location": e.effect.location,
            "gain": round(e.gain, 2),
            "held_out": round(e.elsewhere, 2),
            "material": e.material,
            "significant": significant(e),
        }
        for e in _fallen(result)[:_MOST_TRIED]
        if np.isfinite(e.gain) and np.isfinite(e.elsewhere)
    ]
    content["given_up"] = [
        {
            "effect": one.found.effect.effect,
            "location": one.found.effect.location,
            "parameters": dict(one.found.effect.parameters),
            "gain": round(one.found.gain, 2),
            "held_out": round(one.found.elsewhere, 2),
            "why": one.why,
        }
        for one in not_believed(result)
    ]
    found_by_chance, dropped = chance
    if found_by_chance:
        content["nulls"] = {
            "what": "log-likelihood that the best explanation gains on simulated recordings with nothing "
            "hidden, and how many of them would have raised an alarm; a finding has to exceed the highest",
            "scores": sorted(round(one.score, 2) for one in found_by_chance),
            "alarms": sum(one.alarm for one in found_by_chance),
            "dropped": [f"{c.chosen.effect.effect} at {c.chosen.effect.location}" for c in dropped],
        }
    if doubt is not None:
        content["doubt"] = doubt.why
    beside = []
    if result.nameless is not None and result.choices:
        entry = result.nameless.chosen.effect.entry
        beside.append(f"it looks as if {entry.sentence}, for which there is no name")
    slip = slipped([*uses.fit, *uses.choose])
    if slip is not None and (result.choices or (doubt is not None and doubt.why != slip.why)):
        beside.append(slip.why)
    if overflow is not None:
        beside.append(overflow)
    if beside:
        content["beside"] = "; ".join(beside)
    if verdict.kind == "unknown" and verdict.remaining:
        best = verdict.remaining[0]
        content["residual_curve"] = {
            "equation": best.equation,
            "variable": best.name,
            "unit": best.unit,
            "value": best.centre.tolist(),
            "torque": best.torque.tolist(),
        }
    return content


def _follows(verdict: Verdict) -> dict[str, Any] | None:
    """What the torque that is left follows most, None where it follows nothing to speak of."""
    best = verdict.remaining[0] if verdict.remaining else None
    if best is None or best.explained < FOLLOWS:
        return None
    return {"equation": best.equation, "follows": best.name, "explained": round(best.explained, 3)}


def not_believed(result: SearchResult) -> list[GivenUp]:
    """What was given up and was not found again in another way, every effect at a place once."""
    named = {(c.chosen.effect.effect, c.chosen.effect.location) for c in result.choices}
    found: dict[tuple[str, str], GivenUp] = {}
    for one in result.given_up:
        where = one.found.effect.effect, one.found.effect.location
        if where not in named and np.isfinite(one.found.gain + one.found.elsewhere):
            found.setdefault(where, one)
    return list(found.values())


def _fallen(result: SearchResult) -> list[Explanation]:
    """What was tried in the last round and is not among what was found."""
    stood = [c.chosen.effect for c in (*result.choices, *([result.nameless] if result.nameless else ()))]
    named = {(e.effect, e.location) for e in stood}
    return [e for e in result.last_round if (e.effect.effect, e.effect.location) not in named]


def disturbance(result: SearchResult, fit: Fit, records: Sequence[Record]) -> dict[str, float | None]:
    """Rms of the torques that the observer of a fit adds on the estimation recordings, relative to that of
    the input torque, by equation; None where it has overflowed, or nearly so: no number stands for that."""
    with np.errstate(over="ignore", invalid="ignore"):
        added = np.concatenate([after_settling(r, left_over(fit, r).torque) for r in records])
        found = np.sqrt(np.mean(added**2, axis=0)) / result.scales.size["torque"]
    model = fit.model
    places = [model.location("motor")] if model.rigid else [model.location("motor"), model.location("arm")]
    return {p: float(v) if v < OVERFLOWS else None for p, v in zip(places, found, strict=False)}


def overflows(added: dict[str, dict[str, float | None]]) -> str | None:
    """A sentence on the observers that overflow, None where none does."""
    found = [f"{name} at {place}" for name, one in added.items() for place, v in one.items() if v is None]
    if not found:
        return None
    return (
        f"the observer overflows: the torque that it adds has no size with the {' and the '.join(found)} "
        "(the model cannot be held to the recording)"
    )
