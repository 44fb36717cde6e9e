"""One recording in numbers: parameters with errors, simulated fits, unexplained torque, slips."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_control.recording import Recording
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.diagnosis.decision.adequacy import added_torque
from haptic_teleop_sysid.diagnosis.inputs.plausible import refuse_implausible
from haptic_teleop_sysid.estimation.excitation import at_values
from haptic_teleop_sysid.estimation.records import records_from
from haptic_teleop_sysid.estimation.strategies import estimate
from haptic_teleop_sysid.logs.story import how_read
from haptic_teleop_sysid.recordings.channels import channels_for
from haptic_teleop_sysid.recordings.parameter_units import Units
from haptic_teleop_sysid.results import plain
from haptic_teleop_sysid.runs.estimation_run import Choices, load_one
from haptic_teleop_sysid.simulation.fit import SimulatedFit, choose_windows, simulated_fit


def characterise(bag: str, model: Model, choices: Choices, folder: Path | None = None) -> dict[str, Any]:
    """Return what a trend needs of a recording (``folder`` is not used: the outcome says it all).

    ``parameters``: value and standard error (both None where undetermined) by name; ``unexplained``: rms of
    the torque that the observer adds to follow the recording, relative to that of the input; ``error``: rms
    over the signals of the error of the simulated response, relative to their spread, with the ``given``
    model and with the ``estimate``; ``fit``: the same in percent by signal; ``slips``; ``start_ns``;
    ``damaged``: what of the file is missing, where it is used as far as it goes.

    Raises RecordingError or MismatchError for a recording that cannot be estimated from, or whose search
    ended nowhere.
    """
    recording, data, told = load_one(bag, model, choices)
    refuse_implausible(model, recording, data)
    found = estimate(
        model,
        [data],
        choices.method,
        at_rest=choices.at_rest,
        multi_start=choices.multi_start,
        seed=choices.seed,
        limits=choices.limits,
    )
    if not found.converged or found.uncertainty is None:
        raise RecordingError(
            f"{bag}: the search did not end at an optimum ({found.message}): look at it with `estimate`."
        )
    records = [r for r in records_from(data) if len(r) > 1]
    basis = found.fit if found.fit is not None and not found.misled else at_values(found.model, records)
    windows = choose_windows(found.model, data)
    models = {"given": model, "estimate": found.model}
    fits = {which: simulated_fit(one, data, windows) for which, one in models.items()}
    values, unsure = found.model.parameter_values(), found.uncertainty
    parameters, units = {}, Units.of(model, data)
    for name, std in zip(unsure.names, unsure.std, strict=True):
        known = name not in unsure.undetermined
        parameters[name] = {
            "value": values[name] if known else None,
            "std": float(std) if known else None,
            "unit": units.of_parameter(model, name),
        }
    return plain(
        {
            "start_ns": _begin(recording, model, bag),
            "seconds_long": len(data) * data.dt,
            "parameters": parameters,
            "undetermined": unsure.undetermined,
            "misled": found.misled is not None,
            "unexplained": _overall(added_torque(basis, records), [len(r) for r in records]),
            "error": {which: error_of(fit) for which, fit in fits.items()},
            "fit": {which: fit.percent for which, fit in fits.items()},
            "slips": [asdict(s) for s in data.slips],
            "problems": list(data.problems),
            "damaged": [] if recording.complete else damage_of(recording, bag),
            "treatment": told,
        }
    )


def damage_of(recording: Recording, bag: str) -> list[str]:
    """What is told of a recording of which something is missing."""
    return [*recording.problems, *(line for line in how_read(recording.experiment, bag) if "cut" in line)]


def error_of(fit: SimulatedFit) -> float:
    """Rms over the signals of 1 - fit/100; infinite where the response runs away."""
    shares = [1.0 - percent / 100.0 for percent in fit.percent.values() if not math.isnan(percent)]
    return float(np.sqrt(np.mean(np.square(shares)))) if shares else math.nan


def _overall(shares: np.ndarray, lengths: Sequence[int]) -> float:
    """Rms over the pieces of a recording, by their lengths."""
    return float(np.sqrt(np.average(np.square(shares), weights=lengths)))


def _begin(recording: Recording, model: Model, bag: str) -> int:
    return int(channels_for(model, recording, bag).states.stamp[0])
