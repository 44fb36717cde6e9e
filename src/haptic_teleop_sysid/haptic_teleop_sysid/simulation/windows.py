"""Over which stretches of a recording a model is simulated freely: the whole, or consecutive windows, the
same for all.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_sysid.recordings.dataset import DataSet
from haptic_teleop_sysid.recordings.time_grid import GAP_PERIODS, period_text

DEFAULT_SECONDS = 4.0
"""Length of a window where the recording asks for windows: several periods of the slowest mode (0.76 Hz with
the motor held), yet short against the drift of a free integrator."""
ASKED = "as asked"
"""Why windows are as they are where an option says so."""
SHORTEST = 20
"""Samples below which a window says nothing."""
_LOOP = re.compile(
    r"\b(closed|position|force|velocity|torque|impedance)[ _-]?(loop|control)|scenario", re.IGNORECASE
)


@dataclass(frozen=True)
class Windows:
    """`spans`: (start, stop) in samples, consecutive, none with a hole that was not bridged; `seconds`: the
    length of the longest, None for the whole recording; `why` says in words what asked for it."""

    spans: tuple[tuple[int, int], ...]
    seconds: float | None
    why: str

    @property
    def extent(self) -> str:
        """Over what is simulated, in words."""
        if self.seconds is None:
            return "over the whole recording"
        return f"over {len(self.spans)} consecutive windows of {self.seconds:.2f} s"


def cut(dataset: DataSet, seconds: float | None, why: str) -> Windows:
    """Return windows of `seconds` (the whole for None). Stretches between invalid samples are cut apart, each
    evenly.

    Raises ConfigurationError when no window of SHORTEST samples comes out.
    """
    usable = np.concatenate([[0], _bridged(dataset.valid).astype(np.int8), [0]])
    edges = np.flatnonzero(np.diff(usable))
    spans: list[tuple[int, int]] = []
    for start, stop in edges.reshape(-1, 2).tolist():
        # Equal windows rather than a short rest: the last seconds count like the others.
        parts = 1 if seconds is None else max(1, round((stop - start) * dataset.dt / seconds))
        borders = np.rint(np.linspace(start, stop, parts + 1)).astype(int).tolist()
        spans += [(a, b) for a, b in pairwise(borders) if b - a >= SHORTEST]
    if not spans:
        raise ConfigurationError(
            f"{dataset.name}: no {'stretch' if seconds is None else f'window of {seconds:g} s'} holds "
            f"{SHORTEST} usable samples, which are {period_text(dataset.dt)} apart: {_remedy(seconds, why)}"
        )
    longest = max(b - a for a, b in spans) * dataset.dt
    return Windows(tuple(spans), None if seconds is None else longest, why)


def fewer(all_windows: Sequence[Windows], most: int) -> list[Windows]:
    """Of several recordings' windows every second one, or third, and so on, of each, evenly spread, so that
    ``most`` are left at most, but one of each recording; all where there are no more."""
    step = max(1, math.ceil(sum(len(w.spans) for w in all_windows) / most))
    return [replace(w, spans=w.spans[: max(1, len(w.spans) // step) * step : step]) for w in all_windows]


def _remedy(seconds: float | None, why: str) -> str:
    """What to do where no window comes out; only who asked for windows can ask for longer ones."""
    if seconds is None:
        return "record longer, and without holes."
    if why == ASKED:
        return "give a longer --window."
    return "is the time in another unit? Otherwise record at a higher rate, or without holes."


def _bridged(valid: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """`valid` with the short holes closed whose values were interpolated."""
    closed = valid.copy()
    good = np.flatnonzero(valid)
    for hole in np.flatnonzero((np.diff(good) > 1) & (np.diff(good) <= GAP_PERIODS)):
        closed[good[hole] : good[hole + 1]] = True
    return closed


def closed_loop(dataset: DataSet) -> bool | None:
    """Return whether the recording says that it was made in closed loop; None when it does not say."""
    kind = f"{dataset.experiment.get('kind', '')} {dataset.experiment.get('note', '')}"
    if re.search(r"open[ _-]?loop", kind, re.IGNORECASE):
        return False
    return True if _LOOP.search(kind) else None


def drift_share(errors: dict[str, np.ndarray], measured: dict[str, np.ndarray], samples: int) -> float:
    """Return how much of the position errors is slow wandering: the greatest over the positions of

    std(means of the error over `samples` samples) / std(measured),  counted only where it exceeds the error's
    std within.
    """
    worst = 0.0
    for name, error in errors.items():
        if not name.endswith("position"):
            continue
        parts = np.array_split(error, max(1, round(len(error) / samples)))
        slow = float(np.std([np.mean(part) for part in parts]))
        fast = float(np.sqrt(np.mean([np.var(part) for part in parts])))
        if slow > fast:
            worst = max(worst, slow / max(float(np.std(measured[name])), 1e-12))
    return worst
