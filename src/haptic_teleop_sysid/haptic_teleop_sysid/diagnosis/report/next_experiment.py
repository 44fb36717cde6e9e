"""What to record next, and why: told in the result, and written as a file: one that `acquire` runs, or the
signal as a table for a machine of one's own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from haptic_teleop_control.strict_yaml import dump_yaml
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.records import Record

from ..decision.adequacy import NEARLY_ALL
from ..decision.search.decide import Choice
from ..decision.search.rounds import SearchResult
from ..decision.verdict import Verdict
from ..decision.words import acts, placed, separating
from ..hypotheses.twins import twins
from ..policy import STILL_RANDOM
from .experiment import Suggestion, series, sharpen, suggest, times

#: The files, beside diagnosis.json: for `acquire`, and for another machine.
FILE, SIGNAL_FILE = "next_experiment.yaml", "next_experiment.csv"
#: Probability that the better of two models would be told (one half says nothing) from which an experiment is
#: suggested.
_WORTH_RECORDING = 0.8
#: How to record little and much of what a missing torque follows, by a word of its name.
_VARIED = {
    "angle": "the same motion around two other angles, as far apart as the joint allows",
    "velocity": "the same motion at a third and at three times its speed",
    "deflection": "the same signal at a third and at three times its size, as far as the limits allow",
    "input": "the same signal at a third and at three times its size, as far as the limits allow",
    "time": "the same signal at once and after an hour of work",
    "throughout": "for longer, once with little and once with a large input",
    "which recording it is": "all recordings once more, on one day, with one load",
}
#: Uncertainty of a size, as a share of it, from which it should be made surer.
_UNSURE = 0.2


def next_experiment(result: SearchResult, verdict: Verdict, records: Sequence[Record]) -> dict[str, Any]:
    """What to record next: what separates explanations that the recordings leave
    open, then what makes a size surer."""
    unsure = next((c for c in result.choices if c.ambiguous), None)
    if unsure is not None:
        return _separating(unsure, result, verdict, records)
    tried = [e for e in result.last_round if e.material]
    if verdict.kind in ("no_mismatch", "unknown") and tried:
        names = (placed(tried[0].effect), "the structure found so far")
        found = suggest(tried[0].fit, result.final, names, records[0], result.scales)
        if found is not None:
            return _told(found, found.why)
    if verdict.kind == "unknown" and verdict.where:
        place, condition = verdict.where[0]["equation"], verdict.where[0]["condition"]
        why = (
            f"what has no name sits at {place} and {acts(condition)}: record {varied(condition)}"
        )
        return _without(why, 0.5)
    worst = max(_unsure_sizes(verdict), default=None)
    if worst is not None:
        share, parameter, size, words = worst
        why = f"{words} is known to ± {100.0 * share:.2g} % only"
        if result.final.log_likelihood > -np.inf and parameter in result.final.free:
            found = sharpen(result.final, parameter, size, records[0], result.scales)
            if found is not None:
                return _told(found, f"{why}: {found.why}")
        return _without(f"{why}: record {(share / _UNSURE) ** 2:.0f} times as long, or drive harder", 0.5)
    second = max(
        (c for c in result.choices if c.others), key=lambda c: c.others[0][1], default=None
    )  # not ambiguous, and yet not alone
    if second is not None:
        return _separating(second, result, verdict, records)
    best = verdict.remaining[0] if verdict.remaining else None
    short = verdict.adequacy is not None and verdict.adequacy.least < NEARLY_ALL
    if short and best is not None and best.explained > STILL_RANDOM:
        why = (
            f"what is named does not explain all, and {100 * best.explained:.0f} % of the torque that is "
            f"left at {best.equation} follows the {best.name}: record {varied(best.name)}"
        )
        return _without(why, 0.5)
    doubted = next((c for c in result.choices if c.unsure), None)
    if doubted is not None:
        return _without(
            f"{placed(doubted.chosen.effect)} is not sure, and no experiment is known that would make it so "
            f"({doubted.unsure}): record another motion, in both directions, and diagnose that", 0.5
        )
    return _without("nothing is left to separate; a recording of another day shows whether it lasts", 1.0)


def once_calibrated(encoder: str) -> dict[str, Any]:
    """What to do about an encoder whose error over the angle is known."""
    return _without(
        f"calibrate {encoder}, or subtract the error of reading_error from its readings, and diagnose again: "
        "what else is missing shows then",
        0.5,
    )


def varied(condition: str) -> str:
    """What to record where a torque depends on a quantity, in words: it, little and much."""
    otherwise = f"twice alike, once with little and once with much {condition}"
    return ", then ".join(words for name, words in _VARIED.items() if name in condition) or otherwise


def _separating(
    choice: Choice, result: SearchResult, verdict: Verdict, records: Sequence[Record]
) -> dict[str, Any]:
    """What tells a finding from its runner-up."""
    rival, share = choice.others[0]
    own = choice.chosen.effect
    told = [f for f in verdict.findings if (f["effect"], f["location"]) == (own.effect, own.location)]
    share = min([share, *(f["confidence"] for f in told)])
    names = (placed(choice.chosen.effect), placed(rival.effect))
    found = None
    # What says the same to any recording differs by arithmetic only.
    same = {(e.effect, e.location) for e in twins(own, choice.chosen.fit.model.rigid)}
    if (rival.effect.effect, rival.effect.location) not in same:
        found = suggest(choice.chosen.fit, rival.fit, names, records[0], result.scales)
    text = separating([choice.chosen.effect, rival.effect])
    if not choice.ambiguous:
        text += f" (the runner-up has {100.0 * share:.0f} %)"
    if found is None or found.expected_discrimination < _WORTH_RECORDING:
        return _without(
            f"no excitation within the limits separates {names[0]} from {names[1]}: {text}",
            0.5 if found is None else found.expected_discrimination,
        )
    return _told(found, f"{found.why}; also: {text}")


def _unsure_sizes(verdict: Verdict) -> Iterator[tuple[float, str, float, str]]:
    """Sizes of the findings whose uncertainty is a large share of them (_UNSURE): the share, the parameter's
    full name, how far it is from none, and words."""
    for f in verdict.findings:
        entry = Effect(f["effect"], f["location"]).entry
        for name, p in f["parameters"].items():
            none = entry.parameter(name).neutral
            if none is None or not np.isfinite(none) or entry.parameter(name).default is not None:
                continue
            size = abs(p["value"] - none)
            if size > 0.0 and p["std"] > _UNSURE * size:
                words = f"{name.replace('_', ' ')} of {f['effect']} at {f['location']}"
                yield p["std"] / size, f"{f['location']}.{f['effect']}.{name}", size, words


def _told(found: Suggestion, why: str) -> dict[str, Any]:
    low, high = found.travel
    return {
        "why": f"{why}; simulated, the motor stays between {low:.3g} and {high:.3g} rad",
        "signal_generator": found.signal_generator,
        "expected_discrimination": found.expected_discrimination,
    }


def _without(why: str, chance: float) -> dict[str, Any]:
    return {"why": why, "signal_generator": {}, "expected_discrimination": chance}


def acquire_file(model: Model, experiment: Mapping[str, Any]) -> str | None:
    """The content of a file that `acquire` runs on the robot; None where there is no experiment, or the
    machine is none of those that it drives."""
    if model.robot not in ("sfj", "omni") or not experiment["signal_generator"]:
        return None
    nested: dict[str, Any] = {}
    for key, value in experiment["signal_generator"].items():
        *path, last = key.split(".")
        place = nested
        for part in path:
            place = place.setdefault(part, {})
        place[last] = value
    content = {
        "scenario": {
            "ros__parameters": {
                "nodes": [f"{model.robot}_driver", "acquisition"],
                "note": f"open loop: {experiment['why']}"
                if nested.get("control") == "open_loop"
                else f"position loop: {experiment['why']}",
            }
        },
        "acquisition": {"ros__parameters": nested},
    }
    driver = content["scenario"]["ros__parameters"]["nodes"][0]
    return (
        "# What diagnose suggests to record next. Simulated:\n"
        f"#   haptic-teleop acquire --config {FILE} --output RECORDING --lockstep\n"
        f"# Without --lockstep it MOVES THE ROBOT: it starts {driver}, which drives the hardware\n"
        f"# unless a section {driver} says `device: emulated`. Commission the robot first\n"
        "# (docs/first_contact.md).\n" + dump_yaml(content)
    )


def signal_table(model: Model, experiment: Mapping[str, Any], unit: str) -> str | None:
    """The input of the experiment over time, as CSV for a machine that `acquire` does not drive; ``unit`` of
    the input. None where there is no experiment, or `acquire` runs it."""
    option = experiment["signal_generator"]
    if model.robot in ("sfj", "omni") or not option:
        return None
    at = times(1.0 / float(option["rate"]))
    signal = series(model, option, at)
    if signal is None:
        return None
    rows = [f"{t:.9g},{u:.6g}" for t, u in zip(at, signal, strict=True)]
    return "\n".join([f"time [s],input [{unit}]", *rows, ""])


def write_experiment(folder: Path, model: Model, experiment: Mapping[str, Any], unit: str) -> Path | None:
    """Write the file of the experiment into a folder, and remove what an earlier diagnosis left there; None
    where there is none to write. ``unit`` of the model's input."""
    written = None
    for name, content in (
        (FILE, acquire_file(model, experiment)),
        (SIGNAL_FILE, signal_table(model, experiment, unit)),
    ):
        path = folder / name
        if content is None:
            path.unlink(missing_ok=True)
        else:
            path.write_text(content, encoding="utf-8")
            written = path
    return written
