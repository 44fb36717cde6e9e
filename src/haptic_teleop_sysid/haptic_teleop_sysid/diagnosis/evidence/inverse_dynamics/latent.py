"""Free curves: any function of one or two quantities of the motion.

What the best of them explains is what could be explained at all by a torque at that place; a named effect
that explains much less of it is not the answer, whatever it is better than (restoring-force surfaces: Masri
and Caughey 1979, Kerschen et al. 2006).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.records import Record

from ..hats import between, hat, hats
from .block_means import sparse_block_means
from .effect_variables import turning
from .motion import BandedMotion

FloatArray = NDArray[np.float64]

#: Knots of a curve, and of a surface in either direction.
KNOTS, KNOTS_OF_SURFACE = 25, 6
#: Weight that draws knots to zero, relative to the one that draws them to a straight line.
SLIGHT = 0.05
#: Share of the travel within which the memory of a direction turns.
TURNS = 0.02

#: What a torque at a place may depend on, in words of the report. The input itself is not among it: what its
#: actuator makes of it is no torque along the motion, and other effects than torques say so.
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
#: The torque of the input, of which a map may have all but what is proportional to it: the equations say what
#: the input is, and a part in proportion would explain all of it.
INPUT = "input torque"
#: An angle that starts anew with every turn.
IN_A_TURN = " in a turn"
#: What else a measured torque may follow: at the joint what a gear's teeth, a wobbling coupling or a
#: centrifugal part make of a spring; what comes again with every turn; and at the motor what its actuator
#: makes of the input, at different angles another one (a field that fades). Not over input and velocity:
#: together they nearly are the acceleration, which any friction with a memory follows.
MEASURED_OVER: dict[str, tuple[tuple[str, ...], ...]] = {
    "motor": (
        ("motor angle in a turn",),
        ("motor angle in a turn", "motor velocity"),
        (INPUT,),
        (INPUT, "motor angle"),
    ),
    "arm": (("arm angle in a turn",), ("arm angle in a turn", "arm velocity")),
    "joint": (
        ("motor angle",),
        ("motor angle", "deflection"),
        ("motor velocity", "deflection"),
        ("motor angle in a turn",),
        ("motor angle in a turn", "deflection"),
    ),
}
#: Share of a turn that every recording must cover, so that what comes again with it shows.
COVERED = 0.9
#: Turns from the lowest to the highest angle, up to which a map repeats one.
MOST_TURNS = 50
#: Parts of a turn that are counted.
_PARTS = 40
#: Knots of a turn in a surface, and weight that ties its end to its beginning.
KNOTS_OF_TURN, TIE = 13, 10.0
#: Samples of an input that say how often it has which value, and weight that keeps a function of it from a
#: part in proportion; share of the input below which what is left of it is nothing.
_SAMPLES, _NO_GAIN, _NOTHING = 2000, 1000.0, 1e-6


@dataclass(frozen=True, eq=False)
class Latent:
    """A torque at ``place`` as piecewise linear function of ``quantities`` (one or two), with its ``knots``
    for each; ``samples``: of a function of the input, N·m, values that the quantities had together."""

    location: str
    place: str
    quantities: tuple[str, ...]
    knots: tuple[tuple[float, ...], ...]
    turns: float
    samples: tuple[tuple[float, ...], ...] = ()

    def columns(self, motion: BandedMotion, model: Model) -> FloatArray:
        """Torque (N·m) of each knot's function at the samples that count, (n, columns)."""
        if INPUT in self.quantities:
            return self._of_input(motion, model)
        places, values = np.zeros((len(motion.time), 1), dtype=np.intp), np.ones((len(motion.time), 1))
        number = 1
        for name, knots in zip(self.quantities, self.knots, strict=True):
            left, share = between(quantity(motion, self.place, name, self.turns), np.array(knots))
            at, ends = np.column_stack([left, left + 1]), np.column_stack([1.0 - share, share])
            places = (len(knots) * places[:, :, None] + at[:, None, :]).reshape(len(at), -1)
            values = (values[:, :, None] * ends[:, None, :]).reshape(len(at), -1)
            number *= len(knots)
        means = sparse_block_means(places, values, number, motion.block, motion.first)
        return motion.of_blocks(means, times=2)

    def _of_input(self, motion: BandedMotion, model: Model) -> FloatArray:
        """The same of the input, which is no smooth motion: from all samples, column by column."""
        sides = []
        for name, knots in zip(self.quantities, self.knots, strict=True):
            along = _while_held(motion, model, self.place, name, self.turns)
            sides.append(between(along, np.array(knots)))
        columns = []
        for numbers in itertools.product(*(range(len(knots)) for knots in self.knots)):
            shapes = (hat(left, share, k) for (left, share), k in zip(sides, numbers, strict=True))
            columns.append(motion.filtered(motion.of_input(np.prod([*shapes], axis=0))))
        return np.column_stack(columns)

    def bends(self) -> FloatArray:
        """(rows, columns): second differences of the function along each quantity, all zero for a plane;
        every knot a little, so that a slope that the structure has stays the structure's; and of the input
        what is in proportion to it."""
        sizes = [len(k) for k in self.knots]
        rows = [SLIGHT * np.eye(int(np.prod(sizes)))]
        for axis in range(len(sizes)):
            second = np.diff(np.eye(sizes[axis]), 2, axis=0)
            before, after = (int(np.prod(part)) for part in (sizes[:axis], sizes[axis + 1 :]))
            if self.quantities[axis].endswith(IN_A_TURN):
                second = np.concatenate([second, _tied(sizes[axis])])
            rows.append(np.asarray(np.kron(np.kron(np.eye(before), second), np.eye(after)), dtype=np.float64))
        if self.samples:
            row = self._along_the_input()
            rows.append(_NO_GAIN * row[None, :] / max(float(np.linalg.norm(row)), 1e-300))
        return np.concatenate(rows)

    def _along_the_input(self) -> FloatArray:
        """Mean product (columns,) of each knot's function with what of the input does not follow from the
        other quantity: the velocity follows the input, and where friction carries nearly all of the torque
        the input the velocity; a function of both may have no part in proportion to the rest."""
        values = np.array(self.samples)
        shapes = [hats(along, np.array(knots)) for along, knots in zip(values, self.knots, strict=True)]
        rest = values[self.quantities.index(INPUT)]
        columns = np.ones((len(rest), 1))
        for name, shape in zip(self.quantities, shapes, strict=True):
            columns = (columns[:, :, None] * shape[:, None, :]).reshape(len(rest), -1)
            if name != INPUT:
                rest = rest - shape @ np.linalg.lstsq(shape, rest, rcond=None)[0]
        whole = float(np.linalg.norm(values[self.quantities.index(INPUT)]))
        return rest @ columns / len(rest) * (float(np.linalg.norm(rest)) > _NOTHING * whole)

    @property
    def parameters(self) -> int:
        """How many numbers were sought."""
        return len(self.bounds()[0])

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """No bounds on any column."""
        number = int(np.prod([len(k) for k in self.knots]))
        return np.full(number, -np.inf), np.full(number, np.inf)


def latents(model: Model, motions: Sequence[BandedMotion]) -> Iterator[Latent]:
    """Free curves at every equation; knots over what all motions cover."""
    places = ("motor",) if model.rigid else ("motor", "arm", "joint")
    for place in places:
        yield from _over(model, motions, place, [*((n,) for n in CURVES[place]), *SURFACES[place]])


def measured_over(model: Model, motions: Sequence[BandedMotion], place: str) -> Iterator[Latent]:
    """Further free curves at a place that can be measured, by MEASURED_OVER; none over a turn
    where a map of all of them would be long."""
    angle = np.concatenate([m.angle[:, int(place == "arm")] for m in motions])
    few = float(np.ptp(angle)) < MOST_TURNS * 2.0 * np.pi
    over = [names for names in MEASURED_OVER[place] if few or not names[0].endswith(IN_A_TURN)]
    if not model.rigid:
        # Beside a link that is no spring, a surface over the input takes the place of the motor's equation.
        over = [names for names in over if INPUT not in names or len(names) == 1]
    # A map's input is what an actuator gives, which is another one than the command beside its effects.
    changed = any(e.entry.kind in ("input", "skew") for e in model.effects)
    yield from _over(model, motions, place, [names for names in over if not (changed and INPUT in names)])


def _over(
    model: Model, motions: Sequence[BandedMotion], place: str, quantities: Sequence[tuple[str, ...]]
) -> Iterator[Latent]:
    turns = TURNS * max(float(np.ptp(np.concatenate([_position(m, place) for m in motions]))), 1e-12)
    for names in quantities:
        number = KNOTS if len(names) == 1 else KNOTS_OF_SURFACE
        seen = [[_seen(m, model, place, n, turns) for m in motions] for n in names]
        knots = [_knots(values, number, n) for values, n in zip(seen, names, strict=True)]
        if all(len(k) > 2 for k in knots):
            samples = _samples(motions, model, place, names, turns) if INPUT in names else ()
            yield Latent(model.location(place), place, names, tuple(knots), turns, samples)


def _seen(motion: BandedMotion, model: Model, place: str, name: str, turns: float) -> FloatArray:
    """Values of a quantity by its name: of the motion where it counts, or of the input."""
    if name == INPUT:
        return input_torque(motion.record, model)
    return quantity(motion, place, name, turns)[motion.kept]


def _samples(
    motions: Sequence[BandedMotion], model: Model, place: str, names: tuple[str, ...], turns: float
) -> tuple[tuple[float, ...], ...]:
    """Values of each quantity at _SAMPLES of the samples of all motions that count, the same for each."""
    counting = [(m, m.kept * (m.thin.step or 1)) for m in motions]
    found = [
        np.concatenate([_while_held(m, model, place, n, turns)[kept] for m, kept in counting]) for n in names
    ]
    few = np.unique(np.linspace(0, len(found[0]) - 1, _SAMPLES).astype(np.intp))
    return tuple(tuple(values[few].tolist()) for values in found)


def _while_held(motion: BandedMotion, model: Model, place: str, name: str, turns: float) -> FloatArray:
    """A quantity from each sample of the record to the next, (n,)."""
    if name == INPUT:
        return input_torque(motion.record, model)
    return motion.while_held(quantity(motion, place, name, turns))


def input_torque(record: Record, model: Model) -> FloatArray:
    """Torque of the input, N·m, at the samples of a record, (n,)."""
    return np.asarray(model.parameters["torque_constant"] * record.input, dtype=np.float64)


def quantity(motion: BandedMotion, place: str, name: str, turns: float) -> FloatArray:
    """A quantity of the motion by its name, (n,)."""
    if name == "time":
        return motion.time
    if name.endswith(IN_A_TURN):
        return np.mod(quantity(motion, place, name.removesuffix(IN_A_TURN), turns), 2.0 * np.pi)
    if name.startswith("motor"):
        return (motion.velocity if name == "motor velocity" else motion.angle)[:, 0]
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


def _knots(seen: Sequence[FloatArray], number: int, name: str) -> tuple[float, ...]:
    """Knots halfway between evenly spaced and evenly filled, distinct; of a turn even ones, and none where
    a recording does not cover it."""
    if name.endswith(IN_A_TURN):
        turn = np.linspace(0.0, 2.0 * np.pi, max(number, KNOTS_OF_TURN))
        parts = [np.unique((one / (2.0 * np.pi) * _PARTS).astype(np.intp)) for one in seen]
        return tuple(turn.tolist()) if min(map(len, parts), default=0) >= COVERED * _PARTS else ()
    values = np.concatenate([*seen])
    low, high = np.quantile(values, [0.002, 0.998])
    filled = np.quantile(values, np.linspace(0.002, 0.998, number))
    even = np.linspace(low, high, number)
    return tuple(np.unique(0.5 * (filled + even)).tolist())


def _tied(number: int) -> FloatArray:
    """(2, number): end less beginning of a turn, and of the slopes there."""
    rows = np.zeros((2, number))
    rows[0, [0, -1]] = TIE, -TIE
    rows[1, [0, 1, -2, -1]] = -1.0, 1.0, 1.0, -1.0
    return rows
