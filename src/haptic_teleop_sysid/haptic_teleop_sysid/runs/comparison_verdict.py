"""What a comparison comes to: which model follows the recordings, how well, and what to do."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from haptic_teleop_sysid.recordings.scatter import beyond_scatter
from haptic_teleop_sysid.recordings.small_motion import at_rest, hardly_moving, judged, spread
from haptic_teleop_sysid.report import Status
from haptic_teleop_sysid.runs.comparison import Comparison
from haptic_teleop_sysid.runs.comparison_pictures import percent_text, short, short_bag
from haptic_teleop_sysid.runs.followed import CLOSE, of_mean, of_worst, worse


def conclusion(result: Comparison, command: str = "") -> tuple[Status, str, str, str]:
    """How good the nearest model is, which it is and where it is worst, what to do, and ``command`` where
    that is what to do."""
    means = _means(result)
    best = nearest_model(result)
    nearest = short(best, result)
    others = ", ".join(f"{short(n, result)} {percent_text(m)} %" for n, m in means.items() if n != best)
    bags = " and ".join(short_bag(b, result) for b in result.data)
    if len(result.data) > 3:
        bags = f"{len(result.data)} recordings"
    if others:
        happened = f"{nearest} comes nearest to {bags}: mean fit {percent_text(means[best])} % ({others})."
    else:
        happened = f"{nearest} follows {bags} with a mean fit of {percent_text(means[best])} %."
    if at_rest(result.data.values()):
        # A fit of next to nothing is no alarm, and no proof either.
        return "fair", f"{_still(result)} {happened}", "record a larger motion, and compare on that.", ""
    beyond = _beyond(result, best)
    known = bool(beyond) and np.isfinite(means[best])
    mean = of_mean(float(np.mean([fit for fit, *_ in beyond])) if known else means[best])
    worst = _worst(result, beyond)
    status: Status = "good"
    if worst is not None:
        status, sentence = worst
        happened = f"{happened} {sentence}"
    if worse(status, mean) == "good":
        return "good", happened, f'simulate with "{nearest}".', ""
    todo = "let diagnose find what is missing; Difference in the picture shows when."
    return worse(status, mean), happened, todo, command


def nearest_model(result: Comparison) -> str:
    """The model with the greatest mean fit, by the name that the command line gave it."""
    means = _means(result)
    return max(means, key=lambda name: means[name])


def _means(result: Comparison) -> dict[str, float]:
    """Mean fit of each model over signals and recordings, percent; minus infinity for one that runs away."""
    found = {}
    for name in result.models:
        fits = [percent for percent, _, _ in _fits(result, name)]
        mean = float(np.mean(fits)) if fits else float("nan")
        found[name] = mean if np.isfinite(mean) else float("-inf")
    return found


def _fits(result: Comparison, model: str) -> list[tuple[float, str, str]]:
    """Fits (percent, signal, recording) of a model that a judgement rests on: without signals that hardly
    move where others do, and without recordings in which nothing does where there are others."""
    rest = {bag for bag, dataset in result.data.items() if at_rest([dataset])}
    return [
        (percent, signal, bag)
        for bag, dataset in result.data.items()
        if bag not in rest or len(rest) == len(result.data)
        for signal, percent in judged(result.fits[model, bag].percent, hardly_moving([dataset])).items()
    ]


def _beyond(result: Comparison, model: str) -> list[tuple[float, float, str, str]]:
    """The same fits without what the readings scatter by (`beyond_scatter`), before what they are."""
    return [
        (beyond_scatter({signal: percent}, result.data[bag])[signal], percent, signal, bag)
        for percent, signal, bag in _fits(result, model)
        if np.isfinite(percent)
    ]


def _worst(result: Comparison, beyond: Sequence[tuple[float, float, str, str]]) -> tuple[Status, str] | None:
    """The signal that a model follows worst on any recording, and how good that is, by what `_beyond` says of
    it; None where it comes close to all of them."""
    least, percent, signal, bag = min(beyond, default=(CLOSE, CLOSE, "", ""))
    if (judged_as := of_worst(least)) is None:
        return None
    status, word = judged_as
    where = f" on {short_bag(bag, result)}" if len(result.data) > 1 else ""
    return status, f"Worst is {signal}{where} with {percent_text(percent)} %, which is {word}."


def _still(result: Comparison) -> str:
    """What is said where the joint hardly moves, with how far it does."""
    farthest: dict[str, float] = {}
    for dataset in result.data.values():
        for signal, values in dataset.signals().items():
            unit = dataset.units()[signal]
            if signal.endswith(".position"):
                farthest[unit] = max(farthest.get(unit, 0.0), spread(values))
    moves = ", ".join(f"by {size:.2g} {unit}" for unit, size in farthest.items())
    return f"The joint hardly moves ({moves}), so that a fit tells little of a model."
