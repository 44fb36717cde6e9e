"""The numbers of three models side by side: the user's, its structure re-estimated, and that with what was
found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.gauss_newton import gauss_newton_step
from haptic_teleop_sysid.estimation.prediction_fit import normal_equations
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.step_limits import bounds
from haptic_teleop_sysid.recordings.parameter_units import Units
from haptic_teleop_sysid.recordings.relative_scale import relative_to
from haptic_teleop_sysid.simulation.covariance import scaled_inverse

from ..decision.search.rounds import SearchResult
from ..decision.verdict import Verdict
from ..evidence.certainty import standard_errors
from ..evidence.other_forms import together
from ..inputs.scales import within_reach
from ..policy import SIGNIFICANT

#: Share of its given value by which a parameter must be off to be worth a word; standard errors, spread
#: between recordings included, are asked beside it.
PRACTICAL = 0.05
#: Share of a parameter in a direction of which the recordings say nothing, from which it is not determined.
_UNDETERMINED = 1e-3
_SIDES = ("lowest", "highest")


@dataclass(frozen=True)
class Number:
    """A parameter of one model: ``value`` and ``std`` in ``unit``; ``std`` None where it was not estimated,
    is at a bound or is not determined; ``change``: relative to the given value, None without one; ``bound``:
    lowest | highest where the value is the limit of what was allowed; ``relative_to``: the fixed parameter
    whose error comes on top, one to one, "" for none."""

    value: float
    unit: str
    std: float | None = None
    change: float | None = None
    bound: str | None = None
    relative_to: str = ""

    def content(self) -> dict[str, Any]:
        """The same for a result file."""
        return {
            "value": self.value,
            "unit": self.unit,
            "std": self.std,
            "change": self.change,
            "at_bound": self.bound,
            "relative_to": self.relative_to,
        }


def three_columns(
    given: Model,
    result: SearchResult,
    verdict: Verdict,
    validation: Sequence[Record],
    spread: Mapping[str, float],
) -> dict[str, dict[str, Number]]:
    """The numbers of the given, the re-estimated (``baseline``) and the augmented model; an effect's standard
    errors are those of the findings. ``spread``: what parameters of the augmented model are less sure by."""
    baseline = column(result.baseline.model, given, result.baseline, errors_of(result.baseline, validation))
    both = {"given": column(given, given), "baseline": baseline}
    if not result.choices:
        return both | {"augmented": baseline}
    errors = together(errors_of(result.final, validation), spread)
    for f in verdict.findings:
        head = f"{f['location']}.{f['effect']}."
        errors |= {head + name: float(numbers["std"]) for name, numbers in f["parameters"].items()}
    return both | {"augmented": column(result.final.model, given, result.final, errors)}


def column(
    model: Model, given: Model, fit: Fit | None = None, errors: Mapping[str, float] | None = None
) -> dict[str, Number]:
    """The numbers of ``model``, which was fitted as ``fit`` and starts from ``given``; ``errors``: standard
    errors by full name. How a contact is smoothed is no property of the machine and left out."""
    before, sides = given.parameter_values(), {} if fit is None else at_bounds(fit, given)
    silent = {
        f"{e.location}.{e.effect}.{n}"
        for e in model.effects
        for n, v in e.values.items()
        if not e.entry.parameter(n).reported(v)
    }
    found = {}
    for name, value in model.parameter_values().items():
        if name in silent:
            continue
        free = fit is not None and name in fit.free and name not in sides
        std = (errors or {}).get(name, np.inf)
        first = before.get(name, 0.0)
        found[name] = Number(
            value,
            Units().of_parameter(model, name),
            float(std) if free and np.isfinite(std) else None,
            value / first - 1.0 if first else None,
            sides.get(name),
            relative_to(model, name),
        )
    return found


def at_bounds(fit: Fit, given: Model) -> dict[str, str]:
    """Parameters that ended at the limit of what was allowed (of their physics, or of how far a machine may
    be from ``given``), and at which: lowest | highest."""
    low, high = bounds(fit.model, fit.free, within_reach(given))
    values, sizes = fit.model.parameter_values(), given.parameter_values()
    found = {}
    for name, a, b in zip(fit.free, low, high, strict=True):
        for side, limit, beyond in zip(_SIDES, (a, b), (-1.0, 1.0), strict=True):
            near = 1e-6 * max(abs(limit), abs(sizes.get(name, 0.0)))  # a limit of zero has no size of its own
            if np.isfinite(limit) and beyond * (values[name] - limit) >= -near:
                found[name] = side
    # A fit may have kept nearer to what was given than a machine may be from it.
    for name in fit.at_bound:
        if name in given.parameters and name not in found:
            found[name] = _SIDES[int(values[name] > sizes[name])]
    return found


def with_bounds(findings: Sequence[dict[str, Any]], found: Mapping[str, Number]) -> list[dict[str, Any]]:
    """Findings whose parameters say, where it is so, that they are at a bound."""
    told = []
    for f in findings:
        head = f"{f['location']}.{f['effect']}."
        parameters = {}
        for name, numbers in f["parameters"].items():
            bound = found[head + name].bound if head + name in found else None
            parameters[name] = numbers if bound is None else {**numbers, "at_bound": bound}
        told.append({**f, "parameters": parameters})
    return told


def errors_of(fit: Fit, validation: Sequence[Record]) -> dict[str, float]:
    """Standard errors of a fit's parameters with what they differ by on other recordings beyond chance;
    infinite for what the recordings do not determine.

    What the others want is one Gauss-Newton step away, taken with the noise levels as they are: that is less
    than a fit and tells how far parameters go. Innovations of real machines are autocorrelated, so that
    standard errors alone would be too small."""
    std = standard_errors(fit)
    for name in _undetermined(fit):
        std[name] = float("inf")
    nothing = {name: float("inf") for name in fit.free}
    try:
        information, gradient, value = normal_equations(fit.model, fit.noise, validation, fit.free)
    except (np.linalg.LinAlgError, ValueError):
        return nothing
    if not np.isfinite(value):
        return nothing
    there = standard_errors(replace(fit, information=information))
    everything = np.ones(len(fit.free), dtype=np.bool_)
    step = gauss_newton_step(information, gradient, 0.0, everything)
    for name, apart in zip(fit.free, step, strict=True):
        chance = std.get(name, 0.0) ** 2 + there.get(name, 0.0) ** 2
        if np.isfinite(chance) and apart**2 > SIGNIFICANT**2 * chance:
            std[name] = float(np.sqrt(std[name] ** 2 + (apart**2 - chance) / 2.0))
    return std


def moved(given: Model, numbers: Mapping[str, Number]) -> list[dict[str, Any]]:
    """Parameters of the given model, its effects' too, that differ from the given ones beyond their standard
    errors and by more than PRACTICAL, the most first."""
    found = []
    for name, before in given.parameter_values().items():
        number = numbers.get(name)
        if number is None:  # an effect that gave way to another form of it
            continue
        apart = abs(number.value - before)
        if number.std is None or apart <= max(SIGNIFICANT * number.std, PRACTICAL * abs(before)):
            continue
        found.append(
            {
                "parameter": name,
                "given": before,
                "value": number.value,
                "std": number.std,
                "unit": number.unit,
                "change": number.change,
                "relative_to": number.relative_to,
            }
        )
    return sorted(found, key=lambda m: -np.inf if m["change"] is None else -abs(m["change"]))


def _undetermined(fit: Fit) -> list[str]:
    """Parameters that may change together without any effect on what is predicted (a gain and all that it
    scales)."""
    if not len(fit.free) or not np.all(np.isfinite(fit.information)):
        return list(fit.free)
    nothing = scaled_inverse(fit.information)[2]
    shares = np.sqrt(np.sum(nothing**2, axis=1))
    return [name for name, share in zip(fit.free, shares, strict=True) if share > _UNDETERMINED]
