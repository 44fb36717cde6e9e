"""What says that a model leaves physics out although its own two predictors agree: responses that it follows
poorly, random torques that it needs, one-step errors that are not white."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from haptic_teleop_sysid.diagnosis.policy import MOST_UNNAMED
from haptic_teleop_sysid.estimation.residuals import depends_on_input
from haptic_teleop_sysid.recordings.scatter import beyond_scatter
from haptic_teleop_sysid.recordings.small_motion import at_rest, hardly_moving, judged
from haptic_teleop_sysid.report import Status
from haptic_teleop_sysid.runs.comparison_pictures import percent_text
from haptic_teleop_sysid.runs.estimation_result import Result
from haptic_teleop_sysid.runs.followed import CLOSE, of_mean, of_worst, worse

COLOURED = 0.1
"""Share of the auto-correlations beyond the bound from which one-step errors are not white: ten times that of
a right model. The noise model is tuned to few lags; right models with encoders that step reach 0.08."""
SAME = 0.995
"""Correlation from which two estimates are told as one: it is printed as 1.00."""


@dataclass(frozen=True)
class Doubt:
    """A reason to think that physics is missing, in a sentence."""

    status: Status
    sentence: str


def doubts(result: Result) -> list[Doubt]:
    """Reasons to think that the model leaves something out, the weightiest first; empty for a good one."""
    return [*_followed(result), *_shaken(result), *_coloured(result)]


def _followed(result: Result) -> Iterator[Doubt]:
    """By the scale on which `compare` sends a model to `diagnose`; a fit of next to nothing says nothing, and
    what readings scatter by is no misfit of a model."""
    if at_rest(result.data[bag] for bag in result.judging()):
        return
    fits = []
    for bag in result.judging():
        dataset = result.data[bag]
        told = judged(result.fits["estimate", bag].percent, hardly_moving([dataset]))
        beyond = beyond_scatter(told, dataset)
        fits += [(beyond[s], percent, s, bag) for s, percent in told.items() if np.isfinite(percent)]
    worst, percent, signal, bag = min(fits, default=(CLOSE, CLOSE, "", ""))
    status, word = of_worst(worst) or ("good", "")
    mean = result.mean_fit("estimate")  # of one that runs away not a number
    status = worse(status, of_mean(float(np.mean([fit for fit, *_ in fits])) if np.isfinite(mean) else mean))
    if status == "good":
        return
    where = f" on {bag}" if len(result.data) > 1 else ""
    which = f": {signal}{where} with {percent_text(percent)} %, which is {word}" if word else ""
    yield Doubt(status, f"The model does not follow the motion closely{which}; physics may be missing.")


def _shaken(result: Result) -> Iterator[Doubt]:
    """By the random torque with which alone the model follows the recordings, as in a diagnosis that names
    nothing."""
    found = result.estimate
    if found.fit is None:
        return
    noise, constant = found.fit.noise, found.model.parameters["torque_constant"]
    bags = [bag for bag in result.data if bag not in result.validation] or [*result.data]
    given = constant * float(np.sqrt(np.mean(np.concatenate([result.data[b].input for b in bags]) ** 2)))
    if not given > 0.0:
        return
    share = max(noise.motor_torque, noise.arm_torque) / given
    if share > MOST_UNNAMED:
        yield Doubt(
            "fair",
            f"The model needs a random torque of {100.0 * share:.0f} % of the input's (rms) to follow the "
            "recordings, more than chance is on a machine; physics may be missing.",
        )


def _coloured(result: Result) -> Iterator[Doubt]:
    """By what the one-step errors correlate with."""
    for bag in result.judging():
        for one in result.residuals.get(bag, []):
            auto = one.outside[0]
            said = []
            if auto > COLOURED:
                said.append(f"{100 * auto:.0f} % of their auto-correlations lie beyond the bound")
            if depends_on_input(one):
                said.append("they depend on past inputs")
            if said:
                errors = f"The one-step errors of {one.signal} on {bag} are not white"
                yield Doubt("fair", f"{errors}: {', and '.join(said)}.")


def alike(result: Result) -> list[tuple[str, str, float]]:
    """Pairs of estimates of which one combination is known ten times better than either, with their
    correlation."""
    unsure = result.estimate.uncertainty
    if unsure is None:
        return []
    names, matrix = unsure.names, unsure.correlation
    return [
        (names[j], names[i], float(matrix[i, j]))
        for i in range(len(names))
        for j in range(i)
        if abs(matrix[i, j]) >= SAME  # NaN is not
    ]
