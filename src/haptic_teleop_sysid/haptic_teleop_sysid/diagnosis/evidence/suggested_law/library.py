"""Functions of angle, velocity, deflection and input, and their products, as columns of the regression on the
equations of motion and as text of an effect's equation."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.model import Model

from ..inverse_dynamics.effect_variables import SMOOTHED
from ..inverse_dynamics.latent import input_torque
from ..inverse_dynamics.motion import BandedMotion

FloatArray = NDArray[np.float64]

#: Cycles per revolution that are tried: from a third of a cycle in the travel up, so many per travel.
_FIRST, _PER_TRAVEL, _ORDERS = 1.0 / 3.0, 3, 24
#: Places within the travel, and widths as shares of it, of what acts near one angle.
_PLACES, _WIDTHS = 23, (0.02, 0.035, 0.06, 0.1)


@dataclass(frozen=True)
class Function:
    """One function of one quantity: ``of``: position | velocity | deflection | input; ``text`` in an entry's
    terms (``s.position`` etc., ``p.`` for its shape's numbers); ``raw``: the same of an array and these
    numbers; ``shape``: they by name, with units; ``unit``: of the quantity's power, "1" for what has none."""

    of: str
    text: str
    raw: Callable[..., FloatArray]
    unit: str = "1"
    shape: tuple[tuple[str, float, str], ...] = ()
    #: What the structure of a motor, an arm or a joint does by itself in proportion to this: no law.
    of_structure: bool = False

    def values(self, x: FloatArray) -> FloatArray:
        """The function (n,) of the quantity (n,)."""
        return self.raw(x, *(value for _, value, _ in self.shape))


@dataclass(frozen=True, eq=False)
class Product:
    """A product of functions as a torque at ``place``: what `inverse_dynamics.products` calls a term."""

    location: str
    place: str
    factors: tuple[Function, ...]

    @property
    def text(self) -> str:
        """The product in an entry's terms."""
        return " * ".join(f.text for f in self.factors)

    @property
    def parameters(self) -> int:
        """How many numbers were sought: its coefficient and its shapes."""
        return 1 + sum(len(f.shape) for f in self.factors)

    def columns(self, motion: BandedMotion, model: Model) -> FloatArray:
        """Torque (n, 1) by unit coefficient at the samples that count, filtered like the input."""
        if any(factor.of == "input" for factor in self.factors):
            # The input is no smooth motion: at all samples, not at those that remain.
            parts = [f.values(_while_held(motion, self.place, f.of, model)) for f in self.factors]
            return motion.filtered(motion.of_input(np.prod(parts, axis=0))[:, None])
        found = np.ones(len(motion.time))
        for factor in self.factors:
            found = found * factor.values(_quantity(motion, self.place, factor.of))
        return motion.filtered(found[:, None], times=2)

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """No bounds."""
        return np.array([-np.inf]), np.array([np.inf])


def _while_held(motion: BandedMotion, place: str, name: str, model: Model) -> FloatArray:
    """A quantity from each sample of the record to the next, (n,)."""
    if name == "input":
        return input_torque(motion.record, model)
    return motion.while_held(_quantity(motion, place, name))


def _quantity(motion: BandedMotion, place: str, name: str) -> FloatArray:
    if name == "deflection" or (place == "joint" and name == "position"):
        return motion.angle[:, 0] - motion.angle[:, 1]
    if place == "joint":
        return motion.velocity[:, 0] - motion.velocity[:, 1]
    channel = int(place == "arm")
    return motion.angle[:, channel] if name == "position" else motion.velocity[:, channel]


def library(model: Model, location: str, place: str, quantities: tuple[str, ...], low: float, high: float,
            fastest: float) -> Iterator[Product]:  # fmt: skip
    """All products of at most two functions, of different quantities, for a torque at ``place`` that was seen
    to depend on ``quantities`` (variables of a `TorqueMap`); ``low``, ``high``: travel, rad; ``fastest``:
    rad/s. What the structure has itself (damping, and a joint's spring) is none of them, and
    of the input, of which there are odd and even powers, what is in proportion to it and nothing else."""
    angles = list(angle_functions(low, high)) if {"angle", "deflection"} & set(quantities) else []
    speeds = list(velocity_functions(fastest))
    others = [
        Function("deflection", "s.deflection", lambda x: x, "rad"),
        Function("deflection", "s.abs(s.deflection)", np.abs, "rad"),
    ]
    pushed = [Function("input", "s.abs(s.input)", np.abs, "N*m")] if place != "arm" else []
    by_velocity = bool({"velocity", "deflection_rate"} & set(quantities))
    if "input" in quantities:
        yield from (Product(location, place, (one,)) for one in input_functions())
        for pair in itertools.product(gained_functions(), (one for one in angles if one.text != "1")):
            yield Product(location, place, pair)
        return
    singles: list[Function] = [*angles, *(speeds if by_velocity or not angles else [])]
    for one in singles:
        if not (one.of_structure and (one.of == "velocity" or place == "joint")):
            yield Product(location, place, (one,))
    if not by_velocity:
        return
    mixed = [*others, *pushed] if place != "joint" and not model.rigid else pushed
    few = [one for one in angles if one.text != "1" and not {"angle", "width"} & {n for n, *_ in one.shape}]
    plain = [one for one in speeds if not one.shape]
    for pair in itertools.chain(itertools.product(few, plain), itertools.product(mixed, plain)):
        yield Product(location, place, pair)


def input_functions() -> Iterator[Function]:
    """Functions of the torque of the input, N·m, but for what is in proportion to it."""
    yield Function("input", "1", np.ones_like)
    yield Function("input", "s.abs(s.input)", np.abs, "N*m")
    yield Function("input", "s.input**2", np.square, "N^2*m^2")
    yield Function("input", "s.input * s.abs(s.input)", lambda u: u * np.abs(u), "N^2*m^2")
    yield Function("input", "s.input**3", lambda u: u**3, "N^3*m^3")


def gained_functions() -> Iterator[Function]:
    """Functions of the torque of the input that one of the angle may multiply."""
    yield Function("input", "s.input", lambda u: u, "N*m")
    yield Function("input", "s.abs(s.input)", np.abs, "N*m")


def velocity_functions(fastest: float) -> Iterator[Function]:
    """Functions of the velocity, odd and even."""
    width = SMOOTHED * max(fastest, 1e-12)
    yield Function("velocity", "s.velocity", lambda v: v, "rad/s", of_structure=True)
    yield Function("velocity", "s.direction", lambda v: np.tanh(v / width))
    yield Function("velocity", "s.abs(s.velocity)", np.abs, "rad/s")
    yield Function("velocity", "s.velocity * s.abs(s.velocity)", lambda v: v * np.abs(v), "rad^2/s^2")
    yield Function("velocity", "s.velocity**2", np.square, "rad^2/s^2")
    yield Function("velocity", "s.velocity**3", lambda v: v**3, "rad^3/s^3")
    root = "s.velocity * s.sqrt(s.abs(s.velocity))"
    yield Function("velocity", root, lambda v: v * np.sqrt(np.abs(v)), "rad^1.5/s^1.5")
    for share in (0.05, 0.1, 0.2, 0.4):
        shape = (("speed", share * fastest, "rad/s"),)
        text = "s.velocity * s.exp(-((s.velocity / p.speed) ** 2))"
        yield Function("velocity", text, lambda v, w: v * np.exp(-((v / w) ** 2)), "rad/s", shape)
        # An eddy-current brake (Smythe, Trans. AIEE 61, 1942).
        text = "s.velocity / (1.0 + (s.velocity / p.speed) ** 2)"
        yield Function("velocity", text, lambda v, w: v / (1.0 + (v / w) ** 2), "rad/s", shape)


def _above(q: FloatArray, c: float) -> FloatArray:
    return np.maximum(q - c, 0.0)


def _below(q: FloatArray, c: float) -> FloatArray:
    return np.maximum(c - q, 0.0)


def angle_functions(low: float, high: float) -> Iterator[Function]:
    """Functions of the angle (of the deflection at a joint) over a travel: powers, sines, bumps."""
    travel = max(high - low, 1e-12)
    yield Function("position", "1", np.ones_like)
    yield Function("position", "s.position", lambda q: q, "rad", of_structure=True)
    yield Function("position", "s.abs(s.position)", np.abs, "rad")
    yield Function("position", "s.position**2", np.square, "rad^2")
    yield Function("position", "s.position**3", lambda q: q**3, "rad^3")
    for i in range(1, _PLACES + 1):
        angle = low + travel * i / (_PLACES + 1)
        shape = (("angle", angle, "rad"),)
        yield Function("position", "(s.position - p.angle) ** 3", lambda q, c: (q - c) ** 3, "rad^3", shape)
        yield Function("position", "s.positive_part(s.position - p.angle)", _above, "rad", shape)
        yield Function("position", "s.positive_part(p.angle - s.position)", _below, "rad", shape)
    for i in range(_ORDERS):
        order = 2.0 * math.pi / travel * (_FIRST + i / _PER_TRAVEL)
        shape = (("order", order, "cycles/rev"),)
        yield Function("position", "s.sin(p.order * s.position)", lambda q, n: np.sin(n * q), "1", shape)
        yield Function("position", "s.cos(p.order * s.position)", lambda q, n: np.cos(n * q), "1", shape)
    for i, share in itertools.product(range(1, _PLACES + 1), _WIDTHS):
        angle, width = low + travel * i / (_PLACES + 1), share * travel
        shape = (("angle", angle, "rad"), ("width", width, "rad"))
        yield Function(
            "position",
            "(s.position - p.angle) / p.width * s.exp(0.5 - 0.5 * ((s.position - p.angle) / p.width) ** 2)",
            lambda q, c, w: (q - c) / w * np.exp(0.5 - 0.5 * ((q - c) / w) ** 2),
            "1",
            shape,
        )
