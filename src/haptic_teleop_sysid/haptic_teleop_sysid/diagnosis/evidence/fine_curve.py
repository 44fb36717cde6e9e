"""Does the torque that is missing follow the input in detail, finer than any law or map has it?

A converter that is coarse, a command that is rounded to whole percent, a table in the amplifier: what acts is
another torque at each value of the input, and looks random beside everything else. A curve of many hats over
the input is asked what it gains beside a coarse one, which laws and maps could follow; by chance that is half
a nat a hat. The observer has the input before the innovation that answers to it, so this is right in a closed
loop, too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.kernel import acting_torque, pack
from haptic_teleop_sysid.estimation.gauss_newton import Fit, whiten
from haptic_teleop_sysid.estimation.likelihood import FAILURES, channels, innovations
from haptic_teleop_sysid.estimation.noise import observer
from haptic_teleop_sysid.estimation.records import SHORTEST_PIECE, Record, piece

from ..starts.answers import answers_to

FloatArray = NDArray[np.float64]

#: Hats of the curve (its values at knots, straight between them), each over about as many samples, and the
#: fewest that say anything.
HATS, _FEWEST = 96, 48
#: Every so many knots are those of the coarse curve.
_COARSE = 12
#: Standard deviations by which the curve of the recordings of either kind must gain more than chance: of 40
#: clean pairs of the blind benchmark none exceeds 2.
BEYOND_CHANCE = 6.0
#: Samples of the recordings of either kind that are asked: as many say enough, in some 0.5 GB.
_MOST_SAMPLES = 60_000
#: Share of the largest singular value from which hats count as combinations of others.
_SAME = 1e-4


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
    recordings; 0 where the curve of one kind gains no more than chance, or loses on the other kind."""
    try:
        fits = [(fit, _first(records)) for fit, records in fits]
        knots = _knots(fits)
        if len(knots) < _FEWEST:
            return 0.0
        both = [[_products(fit, r, knots) for r in records] for fit, records in fits]
        sides = [_Gained(np.sum(products, axis=0)) for products in both]
        curves = [side.curve() for side in sides]
    except FAILURES:
        return 0.0
    if min(beyond for _, beyond in curves) < BEYOND_CHANCE:
        return 0.0
    here, there = (torque for torque, _ in curves)
    if sides[0].gain(there) <= 0.0 or sides[1].gain(here) <= 0.0:
        return 0.0
    curve = 0.5 * (here + there)
    detail = curve - _smooth(knots) @ np.linalg.lstsq(_smooth(knots), curve, rcond=None)[0]
    along = np.concatenate([_input(fit, r) for fit, records in fits for r in records])
    return float(np.sqrt(np.mean((_hats(along, knots) @ detail) ** 2)))


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
    return _hats(knots, knots[np.unique(np.append(np.arange(0, len(knots), _COARSE), len(knots) - 1))])


def _input(fit: Fit, record: Record) -> FloatArray:
    return acting_torque(pack(fit.model), record.input, record.dt, record.start)


def _knots(fits: Sequence[tuple[Fit, Sequence[Record]]]) -> FloatArray:
    """Where all kinds of recordings are: a hat beyond one of them would say nothing there."""
    sides = [np.concatenate([_input(fit, r) for r in records]) for fit, records in fits]
    low, high = max(np.min(s) for s in sides), min(np.max(s) for s in sides)
    whole = np.concatenate(sides)
    inside = whole[(whole >= low) & (whole <= high)]
    return np.unique(np.quantile(inside, np.linspace(0.0, 1.0, HATS))) if len(inside) else np.zeros(0)


def _products(fit: Fit, record: Record, knots: FloatArray) -> FloatArray:
    """See `_Gained`, less what the free parameters and the coarse curve explain."""
    packed = pack(fit.model)
    run = innovations(packed, fit.noise, record, fit.free)
    transition, gain, shown = observer(packed, fit.noise, record.dt, channels(packed, record))
    hats = _hats(_input(fit, record), knots)
    answers = answers_to(hats, 0, False, record.read, transition, gain, shown)
    slopes = np.concatenate([run.d_innovation, answers], axis=2)
    errors, slopes = whiten(packed, record, run.innovation, slopes)
    free = run.d_innovation.shape[2]
    known = np.hstack([slopes[:, :free], slopes[:, free:] @ _smooth(knots)])
    length = np.sqrt(np.sum(known**2, axis=0))
    known = np.linalg.qr(known[:, length > 0.0] / length[length > 0.0])[0]
    rest = np.column_stack([slopes[:, free:], errors])
    rest -= known @ (known.T @ rest)
    return np.asarray(rest.T @ rest)


def _hats(values: FloatArray, knots: FloatArray) -> FloatArray:
    """Hats (n, knots) of values (n,); nothing beyond the first and the last."""
    found = np.zeros((len(values), len(knots)))
    there = np.flatnonzero((values >= knots[0]) & (values <= knots[-1]))
    left = np.clip(np.searchsorted(knots, values[there], side="right") - 1, 0, len(knots) - 2)
    share = (values[there] - knots[left]) / (knots[left + 1] - knots[left])
    found[there, left], found[there, left + 1] = 1.0 - share, share
    return found
