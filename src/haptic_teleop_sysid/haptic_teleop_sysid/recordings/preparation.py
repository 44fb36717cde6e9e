"""From a recording to what is estimated from: lead-in, offset, trend, rate and range, each step told in
words."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
import scipy
import yaml

from haptic_teleop_control.errors import ConfigurationError, RecordingError
from haptic_teleop_control.recording import Recording
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.recordings.dataset import DataSet
from haptic_teleop_sysid.recordings.recorded_parameters import recorded_value

PEAK_SAMPLES = 5
"""First samples that an offset ignores, to reject a peak at the start (thesis 3.2.1)."""
MOST_MESSAGES = 5_000_000
"""Messages of a recording beyond which it is refused unread: its arrays would not fit beside each other."""
MOST_SAMPLES = 2_000_000
"""Samples that one estimate takes, all recordings together: derivatives by ten parameters fill 0.5 GB."""
ANGLE_EFFECTS = frozenset(
    {
        "gravity",
        "spring_to_ground",
        "torque_ripple",
        "position_dependent_friction",
        "hard_stop",
        "encoder_eccentricity",
        "viscous_ripple",
        "detent",
        "angle_dependent_inertia",
        "torque_map",
    }
)
"""Effects whose torque depends on where zero is: an offset must not be removed from under them."""


@dataclass(frozen=True)
class Treatment:
    """What is done to a data set. lead_in: "auto", "none" or seconds. offset: "auto" (where there is a
    lead-in and no effect of the model depends on the angle), "remove" or "keep". detrend: "none",
    "constant" or "linear", of angles and input. rate: Hz, or None for the recorded one. span: (start, end)
    s, or None."""

    lead_in: str | float = "auto"
    offset: str = "auto"
    detrend: str = "none"
    rate: float | None = None
    span: tuple[float, float] | None = None


def refuse_huge(path: str | Path) -> None:
    """Raise RecordingError for a recording whose metadata counts more than MOST_MESSAGES, before anything
    is read."""
    metadata = Path(path) / "metadata.yaml"
    try:
        content = yaml.safe_load(metadata.read_text(encoding="utf-8"))
        information = content["rosbag2_bagfile_information"]
        count, hours = information["message_count"], information["duration"]["nanoseconds"] / 3.6e12
    except (OSError, ValueError, KeyError, TypeError, yaml.YAMLError):
        return  # reading it will say what is wrong
    if isinstance(count, int) and count > MOST_MESSAGES:
        raise RecordingError(
            f"{path} holds {count} messages ({hours:.1f} h), more than the {MOST_MESSAGES} that one run "
            "takes: "
            "cut a shorter one out of it, for example with `ros2 bag convert`."
        )


def with_damage_told(dataset: DataSet, recording: Recording) -> DataSet:
    """The data set whose problems also tell of damage to the file, not only of what the stream's stamps
    show."""
    others = [p for p in recording.problems if p not in dataset.problems]
    return replace(dataset, problems=(*others, *dataset.problems))


def prepare(
    dataset: DataSet, recording: Recording, model: Model, treatment: Treatment
) -> tuple[DataSet, list[str]]:
    """Return the treated data set and a sentence for each thing that was done to it.

    Raises ConfigurationError or RecordingError for a treatment that the recording does not permit.
    """
    told: list[str] = []
    lead = (
        lead_in(dataset, recording)
        if treatment.lead_in == "auto"
        else (0.0 if treatment.lead_in == "none" else float(treatment.lead_in))
    )
    dataset = _without_offset(dataset, model, lead, treatment.offset, told)
    if lead >= dataset.dt * (len(dataset) - 10):
        raise ConfigurationError(
            f"{dataset.name} lasts {dataset.dt * len(dataset):.3f} s, and nothing is left behind a lead-in "
            f"of {lead:g} s: give a shorter --lead-in."
        )
    if lead > 0.0:
        dataset = dataset.between(dataset.start + lead, float(dataset.time[-1]))
        told.append(f"the lead-in of {lead:.3g} s was removed")
    if treatment.span is not None:
        dataset = dataset.between(*treatment.span)
        told.append(f"only {dataset.time[0]:.3f} to {dataset.time[-1]:.3f} s are used")
    if treatment.rate is not None:
        dataset = resampled(dataset, treatment.rate)
        told.append(f"resampled to {1.0 / dataset.dt:.6g} Hz")
    if treatment.detrend == "constant" or treatment.detrend == "linear":
        dataset = _detrended(dataset, treatment.detrend)
        told.append(f"the {treatment.detrend} trend of angles and input was removed")
    return dataset, told


def lead_in(dataset: DataSet, recording: Recording) -> float:
    """Seconds before the experiment began: the delay that the acquisition recorded, else the time for which
    exactly nothing was commanded; 0 when there is none (shorter than 0.1 s)."""
    names = ("signal.delay", f"{dataset.joint}.delay")
    stated = recorded_value(recording.parameters, names, ("acquisition",))
    if stated is not None:
        found = stated[0]
    elif dataset.commanded_input is not None and np.any(dataset.commanded_input != 0.0):
        found = dataset.dt * int(np.flatnonzero(dataset.commanded_input != 0.0)[0])
    else:
        found = 0.0
    return found if 0.1 <= found < dataset.dt * (len(dataset) - 10) else 0.0


def resampled(dataset: DataSet, rate: float) -> DataSet:
    """Every k-th sample, with the mean of the input over the k; ConfigurationError unless k is whole (to 1
    %)."""
    factor = 1.0 / (rate * dataset.dt) if rate > 0.0 else 0.0
    k = round(factor)
    if k >= 1 and len(dataset) // k < 10:
        raise ConfigurationError(
            f"{dataset.name}: fewer than ten samples are left at {rate:g} Hz: give a higher --rate."
        )
    if k < 1 or abs(factor - k) > 0.01 * k:
        raise ConfigurationError(
            f"{dataset.name} was recorded at {1.0 / dataset.dt:.6g} Hz, which gives no whole number of "
            "samples at "
            f"{rate:g} Hz: give --rate as that divided by 2, 3, ..."
        )
    n = len(dataset) // k
    mean = {"input", "commanded_input"}
    parts = {}
    for name, value in dataset.__dict__.items():
        if isinstance(value, np.ndarray) and len(value) == len(dataset):
            blocks = value[: n * k].reshape(n, k)
            parts[name] = (
                blocks.mean(axis=1)
                if name in mean
                else (blocks.all(axis=1) if name == "valid" else blocks[:, 0].copy())
            )
    return replace(dataset, **parts, dt=dataset.dt * k)


def _without_offset(dataset: DataSet, model: Model, lead: float, wish: str, told: list[str]) -> DataSet:
    dependent = sorted({e.effect for e in model.effects} & ANGLE_EFFECTS)
    if wish == "keep" or (wish == "auto" and (lead == 0.0 or dependent)):
        if wish == "auto" and lead > 0.0:
            told.append(f"the offset was kept: {', '.join(dependent)} depends on the angle")
        return dataset
    stop = round(lead / dataset.dt)
    if stop < 2 * PEAK_SAMPLES:
        raise ConfigurationError(
            f"{dataset.name} has no lead-in to take an offset from: give --lead-in SECONDS, or --offset keep."
        )
    changes = {}
    for name in ("motor_position", "arm_position"):
        values = getattr(dataset, name)
        if values is not None:
            offset = float(np.mean(values[PEAK_SAMPLES:stop]))
            changes[name] = values - offset
            if offset != 0.0:
                told.append(
                    f"{name.replace('_', ' ')} was moved by {-offset:.4g} rad, its mean in the lead-in"
                )
    return replace(dataset, **changes)


def _detrended(dataset: DataSet, kind: Literal["constant", "linear"]) -> DataSet:
    names = ("motor_position", "arm_position", "input", "commanded_input")
    changes = {n: scipy.signal.detrend(v, type=kind) for n in names if (v := getattr(dataset, n)) is not None}
    return replace(dataset, **changes)
