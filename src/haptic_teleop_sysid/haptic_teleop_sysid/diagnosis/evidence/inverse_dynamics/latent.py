"""Torques without a form: any function of one or two quantities of the motion.

What the best of them explains is what could be explained at all by a torque at that place; a named effect
that explains much less of it is not the answer, whatever it is better than (restoring-force surfaces: Masri
and Caughey 1979, Kerschen et al. 2006).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.model import Model

from .block_means import sparse_block_means
from .motion import BandedMotion
from .terms import turning

FloatArray = NDArray[np.float64]

#: Knots of a curve, and of a surface in either direction.
KNOTS, KNOTS_OF_SURFACE = 25, 6
#: Weight that draws knots to zero, relative to the one that draws them to a straight line.
SLIGHT = 0.05
#: Share of the travel within which the memory of a direction turns.
TURNS = 0.02

#: What a torque at a place may depend on, in words of the report. The input itself is not among it: the
#: equations say what the input is, and any function of it would explain all of it.
CURVES = {
    "motor": ("motor angle", "motor velocity", "displacement since the last reversal", "time"),
    "arm": ("arm angle", "arm velocity", "displacement since the last reversal", "time"),
    "joint": ("deflection", "rate of deflection", "deflection since its last reversal"),
}
SURFACES = {
    "motor": (("motor angle", "motor velocity"), ("motor velocity", "displacement since the last reversal")),
    "arm": (("arm angle", "arm velocity"), ("arm velocity", "displacement since the last reversal")),
    "joint": (("deflection", "rate of deflection"),),
}


@dataclass(frozen=True, eq=False)
class Latent:
    """A torque at ``place`` as piecewise linear function of ``quantities`` (one or two), with its ``knots``
    for each."""

    location: str
    place: str
    quantities: tuple[str, ...]
    knots: tuple[tuple[float, ...], ...]
    turns: float

    def columns(self, motion: BandedMotion, model: Model) -> FloatArray:
        """Torque (N·m) of each knot's function at the samples that count, (n, columns)."""
        places, values = np.zeros((len(motion.time), 1), dtype=np.intp), np.ones((len(motion.time), 1))
        number = 1
        for name, knots in zip(self.quantities, self.knots, strict=True):
            left, share = _between(quantity(motion, self.place, name, self.turns), np.array(knots))
            at, hat = np.column_stack([left, left + 1]), np.column_stack([1.0 - share, share])
            places = (len(knots) * places[:, :, None] + at[:, None, :]).reshape(len(at), -1)
            values = (values[:, :, None] * hat[:, None, :]).reshape(len(at), -1)
            number *= len(knots)
        means = sparse_block_means(places, values, number, motion.block, motion.first)
        return motion.of_blocks(means, times=2)

    def bends(self) -> FloatArray:
        """(rows, columns): second differences of the function along each quantity, all zero for a plane; and
        every knot a little, so that a slope that the structure has stays the structure's."""
        sizes = [len(k) for k in self.knots]
        rows = [SLIGHT * np.eye(int(np.prod(sizes)))]
        for axis in range(len(sizes)):
            second = np.diff(np.eye(sizes[axis]), 2, axis=0)
            before, after = (int(np.prod(part)) for part in (sizes[:axis], sizes[axis + 1 :]))
            rows.append(np.asarray(np.kron(np.kron(np.eye(before), second), np.eye(after)), dtype=np.float64))
        return np.concatenate(rows)

    @property
    def parameters(self) -> int:
        """How many numbers were sought."""
        return len(self.bounds()[0])

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """No bounds on any column."""
        number = int(np.prod([len(k) for k in self.knots]))
        return np.full(number, -np.inf), np.full(number, np.inf)


def latents(model: Model, motions: Sequence[BandedMotion]) -> Iterator[Latent]:
    """Torques without a form at every equation; knots over what all motions cover."""
    places = ("motor",) if model.rigid else ("motor", "arm", "joint")
    for place in places:
        turns = TURNS * max(
            float(np.ptp(np.concatenate([_position(m, place) for m in motions]))), 1e-12
        )
        for names in [(n,) for n in CURVES[place]] + list(SURFACES[place]):
            number = KNOTS if len(names) == 1 else KNOTS_OF_SURFACE
            knots = [
                _knots(np.concatenate([quantity(m, place, n, turns)[m.kept] for m in motions]), number)
                for n in names
            ]
            if all(len(k) > 2 for k in knots):
                yield Latent(model.location(place), place, names, tuple(knots), turns)


def quantity(motion: BandedMotion, place: str, name: str, turns: float) -> FloatArray:
    """A quantity of the motion by its name, (n,)."""
    if name == "time":
        return motion.time
    position = _position(motion, place)
    if "since" in name:
        return turning(np.ascontiguousarray(position), turns)
    if "velocity" in name or "rate" in name:
        v = motion.velocity
        return v[:, 0] - v[:, 1] if place == "joint" else v[:, int(place == "arm")]
    return position


def _position(motion: BandedMotion, place: str) -> FloatArray:
    q = motion.angle
    return q[:, 0] - q[:, 1] if place == "joint" else q[:, int(place == "arm")]


def _knots(values: FloatArray, number: int) -> tuple[float, ...]:
    """Knots halfway between evenly spaced and evenly filled, distinct."""
    low, high = np.quantile(values, [0.002, 0.998])
    filled = np.quantile(values, np.linspace(0.002, 0.998, number))
    even = np.linspace(low, high, number)
    return tuple(np.unique(0.5 * (filled + even)).tolist())


def _between(values: FloatArray, knots: FloatArray) -> tuple[NDArray[np.intp], FloatArray]:
    """Of each value (n,) the knot below it and the share of the way to the next one, 0 to 1: of the piecewise
    linear functions that are 1 at one knot and 0 at the others, constant beyond, these two are not zero."""
    left = np.clip(np.searchsorted(knots, values, side="right") - 1, 0, len(knots) - 2)
    return left, np.clip((values - knots[left]) / (knots[left + 1] - knots[left]), 0.0, 1.0)
