"""Fits of baseline and augmented model on all recordings, over the same windows: the proof of a diagnosis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.dataset import DataSet
from haptic_teleop_sysid.fit import SimulatedFit, choose_windows, simulated_fit


@dataclass(frozen=True)
class Proof:
    """Simulated responses of both models to every data set, in the order given."""

    baseline: tuple[SimulatedFit, ...]
    augmented: tuple[SimulatedFit, ...]


def prove(baseline: Model, augmented: Model, data: Sequence[DataSet]) -> Proof:
    """Simulate both models on every data set; the windows are the baseline's."""
    before, after = [], []
    for dataset in data:
        driven = with_command(dataset)
        windows = choose_windows(baseline, driven)
        before.append(simulated_fit(baseline, driven, windows))
        after.append(simulated_fit(augmented, driven, windows))
    return Proof(tuple(before), tuple(after))


def with_command(dataset: DataSet) -> DataSet:
    """The data set driven by the command where it was recorded, as the diagnosis was."""
    if dataset.commanded_input is None:
        return dataset
    return replace(dataset, input=dataset.commanded_input, input_source="commanded effort")


def mean_percent(fits: Sequence[SimulatedFit]) -> dict[str, float]:
    """Mean fit in percent over recordings, by signal."""
    names = {n for f in fits for n in f.percent}
    return {n: float(np.mean([f.percent[n] for f in fits if n in f.percent])) for n in sorted(names)}
