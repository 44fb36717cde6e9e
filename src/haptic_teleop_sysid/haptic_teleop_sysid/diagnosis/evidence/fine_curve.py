"""Does the torque that is missing follow the input in detail, finer than any law or map has it?

A converter that is coarse, a command that is rounded to whole percent, a table in the amplifier: what acts is
another torque at each value of the input, and looks random beside everything else. A curve of many hats over
the input is asked what it gains beside a coarse one, which laws and maps could follow; by chance that is half
a nat a hat. The observer has the input before the innovation that answers to it, so this is right in a closed
loop, too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.kernel import acting_torque, pack
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import FAILURES, channels, innovations
from haptic_teleop_sysid.estimation.noise import observer
from haptic_teleop_sysid.estimation.records import SHORTEST_PIECE, Record, piece
from haptic_teleop_sysid.estimation.whitening import whiten

from ..starts.answers import answers_to
from .hats import hats

FloatArray = NDArray[np.float64]

#: Hats of the curve (its values at knots, straight between them), each over about as many samples, and the
#: fewest that say anything.
HATS, _FEWEST = 96, 48
#: Every so many knots are those of the coarse curve.
_COARSE = 12
#: Standard deviations by which the curve of the recordings of either kind must gain more than chance: of 40
#: clean pairs of the blind benchmark none exceeds 2; a bare motor on one sine whose clock jitters has 6
#: beside its friction.
BEYOND_CHANCE = 10.0
#: Samples of the recordings of either kind that are asked: as many say enough, in some 0.5 GB.
_MOST_SAMPLES = 60_000
#: Share of the largest singular value from which hats count as combinations of others.
_SAME = 1e-4
#: States of the motor's motion: its angle and its velocity.
_MOTION = (0, 2)
#: A quantity (n,) along a recording, as a fit has it.
Along = Callable[[Fit, Record], FloatArray]


class _Gained(NamedTuple):
    """What hats gain: ``products`` (k + 1, k + 1) of what innovations answer to each, and of them."""

    products: FloatArray

    def curve(self) -> tuple[FloatArray, float]:
        """The torque (k,) at the hats by which the gain is largest, drawn in by what chance has in it; and
        the standard deviations by which that gain exceeds chance."""
        matrix, answered = self.products[:-1, :-1], self.products[:-1, -1]
        length = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
        values, vectors = np.linalg.eigh(matrix / np.outer(length, length))
        kept = values > _SAME * values[-1]
        along = vectors[:, kept].T @ (answered / length)
        gain, by_chance = 0.5 * float(np.sum(along**2 / values[kept])), 0.5 * np.count_nonzero(kept)
        drawn_in = max(1.0 - by_chance / max(gain, 1e-300), 0.0)
        torque = drawn_in * (vectors[:, kept] @ (along / values[kept])) / length
        return torque, (gain - by_chance) / math.sqrt(max(by_chance, 1.0))

    def gain(self, torque: FloatArray) -> float:
        """Nats that a curve gains here."""
        return float(torque @ self.products[:-1, -1] - 0.5 * torque @ self.products[:-1, :-1] @ torque)


def follows_input_finely(fits: Sequence[tuple[Fit, Sequence[Record]]]) -> float:
    """Rms torque that follows the input in detail, N·m, beside a fit with the noise levels of each kind of
    recordings; 0 where the curve of one kind gains no more than chance, or loses on the other kind, or one
    over the motor's velocity or angle gains as far beyond chance: in a motion that repeats itself they have
    the same detail."""
    try:
        fits = [(fit, _first(records)) for fit, records in fits]
        found = _fine(fits, _input)
        if found is None or any(_as_fine(fits, found, state) for state in _MOTION):
            return 0.0
        knots, curve, _ = found
        detail = curve - _smooth(knots) @ np.linalg.lstsq(_smooth(knots), curve, rcond=None)[0]
        along = np.concatenate([_input(fit, r) for fit, records in fits for r in records])
    except FAILURES:
        return 0.0
    return float(np.sqrt(np.mean((hats(along, knots, held=False) @ detail) ** 2)))


class _Fine(NamedTuple):
    """A curve (its values at knots), and how far beyond chance it gains on recordings of either kind."""

    knots: FloatArray
    torque: FloatArray
    beyond: float


def _fine(fits: Sequence[tuple[Fit, Sequence[Record]]], along: Along) -> _Fine | None:
    """The curve over a quantity; None where it gains no more than chance, or loses on the other kind."""
    knots = _knots(fits, along)
    if len(knots) < _FEWEST:
        return None
    both = [[_products(fit, r, knots, along) for r in records] for fit, records in fits]
    sides = [_Gained(np.sum(products, axis=0)) for products in both]
    (here, far), (there, far_there) = (side.curve() for side in sides)
    beyond = min(far, far_there)
    if beyond < BEYOND_CHANCE or sides[0].gain(there) <= 0.0 or sides[1].gain(here) <= 0.0:
        return None
    return _Fine(knots, 0.5 * (here + there), beyond)


def _as_fine(fits: Sequence[tuple[Fit, Sequence[Record]]], found: _Fine, state: int) -> bool:
    """Whether a curve over a predicted state gains as far beyond chance as one that was found."""

    def along(fit: Fit, record: Record) -> FloatArray:
        return np.asarray(innovations(pack(fit.model), fit.noise, record).states[:, state], dtype=np.float64)

    other = _fine(fits, along)
    return other is not None and other.beyond >= found.beyond


def _first(records: Sequence[Record]) -> list[Record]:
    """The records, or the first _MOST_SAMPLES of them."""
    found, left = list[Record](), _MOST_SAMPLES
    for record in records:
        if left >= SHORTEST_PIECE:
            found.append(piece(record, 0, left) if len(record) > left else record)
            left -= len(record)
    return found


def _smooth(knots: FloatArray) -> FloatArray:
    """The coarse hats at the knots (knots, coarse ones)."""
    every = np.append(np.arange(0, len(knots), _COARSE), len(knots) - 1)
    return hats(knots, knots[np.unique(every)], held=False)


def _input(fit: Fit, record: Record) -> FloatArray:
    return acting_torque(pack(fit.model), record.input, record.dt, record.start)


def _knots(fits: Sequence[tuple[Fit, Sequence[Record]]], along: Along) -> FloatArray:
    """Where all kinds of recordings are: a hat beyond one of them would say nothing there."""
    sides = [np.concatenate([along(fit, r) for r in records]) for fit, records in fits]
    low, high = max(np.min(s) for s in sides), min(np.max(s) for s in sides)
    whole = np.concatenate(sides)
    inside = whole[(whole >= low) & (whole <= high)]
    return np.unique(np.quantile(inside, np.linspace(0.0, 1.0, HATS))) if len(inside) else np.zeros(0)


def _products(fit: Fit, record: Record, knots: FloatArray, along: Along) -> FloatArray:
    """See `_Gained`, less what the free parameters and the coarse curve explain."""
    packed = pack(fit.model)
    run = innovations(packed, fit.noise, record, fit.free)
    transition, gain, shown = observer(packed, fit.noise, record.dt, channels(packed, record))
    torques = hats(along(fit, record), knots, held=False)
    answers = answers_to(torques, 0, False, record.read, transition, gain, shown)
    slopes = np.concatenate([run.d_innovation, answers], axis=2)
    errors, slopes = whiten(packed, record, run.innovation, slopes)
    free = run.d_innovation.shape[2]
    known = np.hstack([slopes[:, :free], slopes[:, free:] @ _smooth(knots)])
    length = np.sqrt(np.sum(known**2, axis=0))
    known = np.linalg.qr(known[:, length > 0.0] / length[length > 0.0])[0]
    rest = np.column_stack([slopes[:, free:], errors])
    rest -= known @ (known.T @ rest)
    return np.asarray(rest.T @ rest)
