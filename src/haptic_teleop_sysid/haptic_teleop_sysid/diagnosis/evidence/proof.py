"""Fits of the given, the re-estimated and the augmented model on all recordings, over the same windows: the
proof of a diagnosis."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.recordings.dataset import DataSet
from haptic_teleop_sysid.simulation.fit import SimulatedFit, choose_windows, simulated_fit
from haptic_teleop_sysid.simulation.windows import SHORTEST, Windows, cut

from ..inputs.coarse import coarser, thinned_data
from ..inputs.uses import Uses, with_command

MODELS: tuple[str, ...] = ("given", "baseline", "augmented")
"""The user's model as it came, its structure re-estimated, and that with what was found."""
PARTS: tuple[str, ...] = ("estimation", "validation", "test")
"""What models were fitted to, what chose among them, and what did neither."""


@dataclass(frozen=True)
class Proof:
    """``models`` by the names of MODELS; ``parts``: recordings by those of PARTS; ``fits[model][part]``: the
    simulated responses, recording by recording."""

    models: dict[str, Model]
    parts: dict[str, tuple[DataSet, ...]]
    fits: dict[str, dict[str, tuple[SimulatedFit, ...]]]

    @property
    def best_part(self) -> str:
        """The part that says most about other recordings: the test, else the validation."""
        return "test" if self.parts["test"] else "validation"

    def mean(self, model: str, part: str) -> float:
        """Mean fit over signals and recordings, percent, each at least LOWEST."""
        found = [p for f in self.fits[model][part] for p in f.percent.values() if not np.isnan(p)]
        return float(np.mean(np.maximum(found, LOWEST)))

    def content(self) -> dict[str, Any]:
        """The `fit` of diagnosis.json."""
        percent = {
            model: {part: mean_percent(found) for part, found in by_part.items()}
            for model, by_part in self.fits.items()
        }
        baseline = self.fits["baseline"]
        told = [(d, f) for part in PARTS for d, f in zip(self.parts[part], baseline[part], strict=True)]
        return {
            **percent,
            "window_s": baseline["validation"][-1].windows.seconds,
            "windows": "; ".join(f"{d.name}: simulated {f.windows.extent}, {f.windows.why}" for d, f in told),
        }


#: Fit (percent) below which a simulation is merely wrong, as which one that runs away counts.
LOWEST = -100.0


@dataclass(frozen=True)
class Course:
    """Recordings with the windows over which every model of one diagnosis is simulated."""

    data: tuple[DataSet, ...]
    windows: tuple[Windows, ...]
    #: What was simulated last, because several questions are asked of the same model.
    known: deque[tuple[Model, tuple[SimulatedFit, ...]]] = field(default_factory=lambda: deque(maxlen=6))
    #: s, of the longest window that may be, and why; None where windows may have any length.
    most: tuple[float, str] | None = None

    @staticmethod
    def of(baseline: Model, data: Sequence[DataSet]) -> Course:
        """The recordings, driven by the command; the baseline says whether windows are needed."""
        driven = tuple(with_command(d) for d in data)
        return Course(driven, tuple(choose_windows(baseline, d) for d in driven))

    def no_longer_than(self, seconds: float, why: str) -> Course:
        """The same recordings in windows of ``seconds`` at most, or of SHORTEST samples where those last
        longer; as they are where a recording has no such stretch."""
        least = SHORTEST * max(d.dt for d in self.data)
        cut_to = replace(self, known=deque(maxlen=6), most=(max(seconds, least), why))
        parts = zip(self.data, self.windows, strict=True)
        try:
            return replace(cut_to, windows=tuple(cut_to.shortened(d, w) for d, w in parts))
        except ConfigurationError:
            return self

    def shortened(self, data: DataSet, windows: Windows) -> Windows:
        """Windows of a recording, cut anew where they are longer than they may be."""
        if self.most is None or (windows.seconds is not None and windows.seconds <= self.most[0]):
            return windows
        return cut(data, *self.most)

    def coarse(self, cutoff: float) -> Course:
        """The same windows of thinned recordings, for motion in the band up to ``cutoff``, Hz."""
        thin = thinned_data(self.data, cutoff)
        windows = tuple(coarser(w, k) for w, (_, k) in zip(self.windows, thin, strict=True))
        return Course(tuple(d for d, _ in thin), windows)

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
        end so and that are not constant."""
        return tuple(
            float(np.mean([max(p, LOWEST) for n, p in f.percent.items() if n.endswith(ending) and p == p]))
            for f in self.simulate(model)
        )


def prove(given: Model, baseline: Model, augmented: Model, course: Course, uses: Uses) -> Proof:
    """Simulate the three models on every recording, over the same windows; ``course``: of what was fitted to
    and what chose."""
    models = dict(zip(MODELS, (given, baseline, augmented), strict=True))
    n, shown = len(uses.fit), uses.show.simulated(list(models.values()), baseline, course.shortened)
    fits = {}
    for (name, model), test in zip(models.items(), shown, strict=True):
        both = course.simulate(model)
        fits[name] = dict(zip(PARTS, (both[:n], both[n:], test), strict=True))
    parts = dict(zip(PARTS, (uses.fit, uses.choose, uses.show.recordings), strict=True))
    return Proof(models, parts, fits)


def mean_percent(fits: Sequence[SimulatedFit]) -> dict[str, float]:
    """Mean fit in percent over recordings, by signal."""
    names = {n for f in fits for n in f.percent}
    return {n: float(np.mean([f.percent[n] for f in fits if n in f.percent])) for n in sorted(names)}
