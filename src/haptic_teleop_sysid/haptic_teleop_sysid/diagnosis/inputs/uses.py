"""Three uses of recordings, kept apart: to fit, to choose, and to show.

What a model was fitted to flatters it, and so does what it was chosen by.  Only recordings that did neither
say how a model does on others (Hastie, Tibshirani and Friedman, The Elements of Statistical Learning, 2009,
ch. 7.2).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.recordings.dataset import DataSet
from haptic_teleop_sysid.simulation.fit import SimulatedFit, choose_windows, simulated_fit
from haptic_teleop_sysid.simulation.windows import Windows

from .cuts import SHORTEST_STRETCH

#: Validation (s) from which a part of it is kept to show with, that part, and the share by which a recording
#: may be shorter than it is said to be: samples are lost at its ends.
LONG_ENOUGH, KEPT_SHARE, _LOST = 60.0, 1.0 / 3.0, 0.01
#: Shortest piece (s) that a recording is cut into.
SHORTEST_PIECE = 5.0
#: Share of its excitation's power that the kept part must have at frequencies at which the rest has it, too:
#: of a sweep it is 0.4 at most, of noise or sines of one band it is nearly 1.
SAME_BAND = 0.5


@dataclass(frozen=True)
class Shown:
    """Recordings on which finished models are simulated, and with which nothing else is done: what fits and
    what chooses takes data sets, and this is none."""

    recordings: tuple[DataSet, ...] = ()

    def simulated(
        self, models: Sequence[Model], baseline: Model, shortened: Callable[[DataSet, Windows], Windows]
    ) -> list[tuple[SimulatedFit, ...]]:
        """The responses of each model, recording by recording, over the same windows; the baseline says
        whether windows are needed, and ``shortened`` how long they may be."""
        driven = [with_command(d) for d in self.recordings]
        windows = [shortened(d, choose_windows(baseline, d)) for d in driven]
        return [
            tuple(simulated_fit(model, d, w) for d, w in zip(driven, windows, strict=True))
            for model in models
        ]


@dataclass(frozen=True)
class Uses:
    """``fit``: what models are fitted to; ``choose``: what chooses among them; ``show``: what does neither;
    ``told``: where that comes from, in words; ``problems``: of the recordings as they were given, by name."""

    fit: tuple[DataSet, ...]
    choose: tuple[DataSet, ...]
    show: Shown
    told: str
    problems: dict[str, list[str]]

    def changed(self, change: Callable[[DataSet], DataSet]) -> Uses:
        """The same uses of recordings that are changed all alike."""
        fit, choose, show = (tuple(map(change, s)) for s in (self.fit, self.choose, self.show.recordings))
        more = {d.name: list(d.problems) for d in (*fit, *choose, *show)}
        return replace(self, fit=fit, choose=choose, show=Shown(show), problems=self.problems | more)


def three_uses(
    estimation: Sequence[DataSet], validation: Sequence[DataSet], test: Sequence[DataSet] = ()
) -> Uses:
    """The recordings by their use. Without ``test`` the last third of the validation is kept to show with,
    where there are LONG_ENOUGH seconds of it and the excitation keeps its band."""
    problems = {d.name: list(d.problems) for d in (*estimation, *validation, *test)}
    choose, show, told = tuple(validation), tuple(test), "the test recordings"
    if not test:
        choose, show, told = _kept_back(choose)
    told += (
        " were neither fitted to nor used to choose"
        if show
        else ": the fits to the validation recordings are of recordings that were also used to choose"
    )
    return Uses(tuple(estimation), choose, Shown(show), told, problems)


def _kept_back(validation: tuple[DataSet, ...]) -> tuple[tuple[DataSet, ...], tuple[DataSet, ...], str]:
    """The validation without what is kept of it to show with, that, and why, in words."""
    seconds = sum(usable_seconds(d) for d in validation)
    if seconds < (1.0 - _LOST) * LONG_ENOUGH:
        why = f"there are no test recordings and less than {LONG_ENOUGH:g} s of validation ({seconds:.3g} s)"
        return validation, (), why
    rest, kept = _without_last(validation, KEPT_SHARE * seconds)
    if not kept:
        return validation, (), "there are no test recordings, and holes leave no third of the validation"
    if shared_band(rest, kept) < SAME_BAND:
        why = "there are no test recordings, and the last third of the validation is excited in another band"
        return validation, (), why
    names = ", ".join(d.name for d in kept)
    return rest, kept, f"the last third of the validation is kept for a test; its recordings ({names})"


def shared_band(rest: Sequence[DataSet], kept: Sequence[DataSet]) -> float:
    """Share (0 to 1) of the power of the excitation in ``kept`` that lies where ``rest`` has its own: the
    overlap of both spectra by octaves, each of unit power, whatever the amplitudes."""
    lowest = 2.0 / min(d.dt * len(d) for d in (*rest, *kept))
    one, other = (_by_octaves(part, lowest) for part in (rest, kept))
    length = max(len(one), len(other))
    one, other = (np.pad(p, (0, length - len(p))) for p in (one, other))
    return float(np.sum(np.minimum(one, other)))


def with_command(dataset: DataSet) -> DataSet:
    """The data set driven by the command where it was recorded, as the diagnosis was."""
    if dataset.commanded_input is None:
        return dataset
    return replace(dataset, input=dataset.commanded_input, input_source="commanded effort")


def _by_octaves(data: Sequence[DataSet], lowest: float) -> NDArray[np.float64]:
    """Power of the input by octaves above ``lowest`` (Hz), in all one; what lies below is in the first."""
    energy = np.zeros(64)
    for d in data:
        frequency, power = scipy.signal.periodogram(np.nan_to_num(with_command(d).input), 1.0 / d.dt, "hann")
        octave = np.floor(np.log2(np.maximum(frequency / lowest, 1.0))).astype(int)
        energy += np.bincount(octave, power * len(d) * d.dt, minlength=64)
    return energy / max(float(energy.sum()), 1e-300)


def _without_last(
    data: tuple[DataSet, ...], seconds: float
) -> tuple[tuple[DataSet, ...], tuple[DataSet, ...]]:
    """The recordings without their last ``seconds``, and these: whole recordings as far as they go, so that
    as few as possible are cut, and no piece shorter than SHORTEST_PIECE."""
    rest, kept = list(data), []
    while usable_seconds(rest[-1]) <= seconds + SHORTEST_PIECE:
        seconds -= usable_seconds(rest[-1])
        kept.insert(0, rest.pop())
    if seconds >= SHORTEST_PIECE:
        first, last = cut_behind(rest[-1], seconds)
        if min(longest_stretch(first), longest_stretch(last)) >= SHORTEST_STRETCH:
            rest[-1] = first
            kept.insert(0, last)
    return tuple(rest), tuple(kept)


def longest_stretch(dataset: DataSet) -> int:
    """Samples of a recording's longest stretch without a hole."""
    if not len(dataset.valid):
        return len(dataset)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], dataset.valid.astype(np.int8), [0]])))
    return int(np.max(edges[1::2] - edges[::2], initial=0))


def usable_seconds(dataset: DataSet) -> float:
    """Seconds of a recording that are no hole."""
    return dataset.dt * (int(np.count_nonzero(dataset.valid)) if len(dataset.valid) else len(dataset))


def cut_behind(dataset: DataSet, seconds: float) -> tuple[DataSet, DataSet]:
    """A recording without its last ``seconds`` of usable samples, and these."""
    usable = dataset.valid if len(dataset.valid) else np.ones(len(dataset), dtype=np.bool_)
    behind = np.cumsum(usable[::-1])[::-1]
    border = int(np.flatnonzero(behind * dataset.dt > seconds)[-1]) + 1
    time = float(dataset.time[border])
    ends, half = (float(dataset.time[0]), float(dataset.time[-1])), 0.5 * dataset.dt
    first, last = dataset.between(ends[0], time - half), dataset.between(time - half, ends[1])
    slips = dataset.slips
    return (
        replace(
            first,
            name=f"{dataset.name} (until {time:.2f} s)",
            slips=tuple(s for s in slips if s.time < time),
        ),
        replace(
            last,
            name=f"{dataset.name} (from {time:.2f} s)",
            slips=tuple(s for s in slips if s.time >= time),
        ),
    )
