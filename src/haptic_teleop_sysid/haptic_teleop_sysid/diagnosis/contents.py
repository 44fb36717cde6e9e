"""The content of diagnosis.json: the contract's keys, and what docs/diagnosis.md lists beside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from haptic_teleop_sysid.estimation.gauss_newton import Fit
from haptic_teleop_sysid.estimation.likelihood import settled
from haptic_teleop_sysid.estimation.records import Record

from .beside_given import beside_given
from .columns import Number, moved
from .decide import Choice, significant
from .experiment import suggest
from .explanation import Explanation
from .nulls import Null
from .proof import PARTS, Proof
from .reasons import Doubt, slipped
from .residual import left_over
from .search import SearchResult
from .stand import Stand
from .uses import Uses
from .verdict import Verdict
from .whiteness import LAGS
from .words import called, separating

#: How many of the explanations that did not stand up are told.
_MOST_TRIED = 10
#: Probability that the better of two models would be told (one half says nothing) from which an experiment is
#: suggested.
_WORTH_RECORDING = 0.8


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
) -> dict[str, Any]:
    """Everything but run time and version; ``columns``: the numbers of the proof's models; ``records``: those
    of the estimation recordings; ``chance``: what was found where nothing is hidden, and the findings that
    did not exceed it."""
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
        **beside_given(proof),
        "parameters_moved": [],
        "uses": {part: [d.name for d in proof.parts[part]] for part in PARTS} | {"what": uses.told},
        "recordings": uses.problems,
        "next_experiment": next_experiment(result, verdict, records),
        "baseline_parameters": result.baseline.model.parameter_values(),
        "innovations": {
            "what": f"portmanteau statistic over {LAGS} lags, {LAGS} on average for white innovations",
            "baseline": dict(zip(("estimation", "validation"), stand.before, strict=True)),
            "augmented": dict(zip(("estimation", "validation"), stand.after, strict=True)),
        },
        "disturbance": {
            "what": "rms torque that the observer adds at motor and arm, relative to the rms input torque",
            "baseline": disturbance(result, result.baseline, records),
            "augmented": disturbance(result, result.final, records),
        },
    }
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
    found_by_chance, dropped = chance
    if found_by_chance:
        content["nulls"] = {
            "what": "score (nats) of the best explanation on simulated recordings with nothing hidden, and "
            "how many of them would have raised an alarm; a finding has to exceed the highest",
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
    apart = slipped([*uses.fit, *uses.choose])
    if apart is not None and (result.choices or (doubt is not None and doubt.why != apart.why)):
        beside.append(apart.why)
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


def _fallen(result: SearchResult) -> list[Explanation]:
    """What was tried in the last round and is not among what was found."""
    stood = [c.chosen.effect for c in (*result.choices, *([result.nameless] if result.nameless else ()))]
    named = {(e.effect, e.location) for e in stood}
    return [e for e in result.last_round if (e.effect.effect, e.effect.location) not in named]


def disturbance(result: SearchResult, fit: Fit, records: Sequence[Record]) -> dict[str, float]:
    """Rms of the torques that the observer of a fit adds on the estimation recordings, relative to that of
    the input torque, by equation."""
    added = np.concatenate([settled(r, left_over(fit, r).torque) for r in records])
    motor, arm = np.sqrt(np.mean(added**2, axis=0)) / result.scales.size["torque"]
    model = fit.model
    found = {model.location("motor"): float(motor)}
    return found if model.rigid else found | {model.location("arm"): float(arm)}


def next_experiment(result: SearchResult, verdict: Verdict, records: Sequence[Record]) -> dict[str, Any]:
    """What to record next, as the contract has it."""
    unsure = next((c for c in result.choices if c.ambiguous), None)
    if unsure is not None:
        rival = unsure.others[0][0]
        names = (called(unsure.chosen.effect), called(rival.effect))
        found = suggest(unsure.chosen.fit, rival.fit, names, records[0], result.scales)
        text = separating([unsure.chosen.effect, rival.effect])
        if found is None or found.expected_discrimination < _WORTH_RECORDING:
            return {
                "why": f"no excitation within the limits separates {names[0]} from {names[1]}: {text}",
                "signal_generator": {},
                "expected_discrimination": 0.5 if found is None else found.expected_discrimination,
            }
        return {
            "why": f"{found.why}; also: {text}",
            "signal_generator": found.signal_generator,
            "expected_discrimination": found.expected_discrimination,
        }
    tried = [e for e in result.last_round if e.material]
    if verdict.kind in ("no_mismatch", "unknown") and tried:
        names = (called(tried[0].effect), "the structure found so far")
        found = suggest(tried[0].fit, result.final, names, records[0], result.scales)
        if found is not None:
            return {
                "why": found.why,
                "signal_generator": found.signal_generator,
                "expected_discrimination": found.expected_discrimination,
            }
    if verdict.kind == "unknown" and verdict.where:
        place, condition = verdict.where[0]["equation"], verdict.where[0]["condition"]
        return {
            "why": f"what has no name sits at {place} and depends on {condition}: record twice alike but for "
            "that, little of it once and much of it once",
            "signal_generator": {},
            "expected_discrimination": 0.5,
        }
    return {
        "why": "nothing is left to separate; a recording of another day would show drift",
        "signal_generator": {},
        "expected_discrimination": 1.0,
    }
