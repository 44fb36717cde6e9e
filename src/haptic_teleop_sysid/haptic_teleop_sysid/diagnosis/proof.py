"""Fits of baseline and augmented model on all recordings, over the same windows: the proof of a diagnosis."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.dataset import DataSet
from haptic_teleop_sysid.fit import SimulatedFit, choose_windows, simulated_fit
from haptic_teleop_sysid.windows import Windows


@dataclass(frozen=True)
class Proof:
    """Simulated responses of both models to every data set, in the order given."""

    baseline: tuple[SimulatedFit, ...]
    augmented: tuple[SimulatedFit, ...]


@dataclass(frozen=True)
class Course:
    """Recordings with the windows over which every model of one diagnosis is simulated."""

    data: tuple[DataSet, ...]
    windows: tuple[Windows, ...]
    #: What was simulated last, because several questions are asked of the same model.
    known: deque[tuple[Model, tuple[SimulatedFit, ...]]] = field(default_factory=lambda: deque(maxlen=6))

    @staticmethod
    def of(baseline: Model, data: Sequence[DataSet]) -> Course:
        """The recordings, driven by the command; the baseline says whether windows are needed."""
        driven = tuple(with_command(d) for d in data)
        return Course(driven, tuple(choose_windows(baseline, d) for d in driven))

    def simulate(self, model: Model) -> tuple[SimulatedFit, ...]:
        """The model's simulated responses, recording by recording."""
        for before, fits in self.known:
            if before == model:
                return fits
        fits = tuple(simulated_fit(model, d, w) for d, w in zip(self.data, self.windows, strict=True))
        self.known.append((model, fits))
        return fits

    def percent(self, model: Model, ending: str = "") -> tuple[float, ...]:
        """Mean simulated fit (percent, each signal at least -100) of each recording, over signals whose names
        end so."""
        return tuple(
            float(np.mean([max(p, -100.0) for n, p in f.percent.items() if n.endswith(ending)]))
            for f in self.simulate(model)
        )


def prove(baseline: Model, augmented: Model, course: Course) -> Proof:
    """Simulate both models on every recording, over the same windows."""
    return Proof(course.simulate(baseline), course.simulate(augmented))


def with_command(dataset: DataSet) -> DataSet:
    """The data set driven by the command where it was recorded, as the diagnosis was."""
    if dataset.commanded_input is None:
        return dataset
    return replace(dataset, input=dataset.commanded_input, input_source="commanded effort")


def mean_percent(fits: Sequence[SimulatedFit]) -> dict[str, float]:
    """Mean fit in percent over recordings, by signal."""
    names = {n for f in fits for n in f.percent}
    return {n: float(np.mean([f.percent[n] for f in fits if n in f.percent])) for n in sorted(names)}
