"""Effects as columns of a regression: the torque of each along a motion, by unit size.

Written from the effects' own entries: an effect that is added there appears here by itself, as long as it is
a torque that its equation gives along a motion.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.effects import EffectEntry, EffectParameter
from haptic_teleop_sim.kernel import acting_torque, pack
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.records import Record

from ...hypotheses.along_motion import inertia_torque
from .effect_variables import variables_of
from .motion import BandedMotion
from .sampled import apart_from_shape, linear
from .term import Term

FloatArray = NDArray[np.float64]

#: Relative standard error of a parameter that a grid has.
_STEP_OF_GRID = 0.1
#: Factor by which a size may be off at which an equation was evaluated that is not linear in it.
_OFF = 1.5


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """An effect at a place, with the shape at which it is tried: all its parameters but the sizes.

    ``gives``: displacement over which the memory of its direction turns, 0 where the sign of the velocity
    does; ``sizes``: parameters that multiply columns; ``turned``: the size that an angle (``angle``) turns
    or offsets, which is a second column; ``held``: a size at which the equation, not linear in it, was
    evaluated: its column's factor is 1 where that size is right.
    """

    entry: EffectEntry
    location: str
    place: str
    shape: tuple[tuple[str, float], ...]
    sizes: tuple[str, ...]
    angle: str | None
    gives: float = 0.0
    held: bool = False

    def columns(self, motion: BandedMotion, model: Model) -> FloatArray:
        """Torques (N·m) that it adds at the samples that count, (n, columns), filtered like the input."""
        if self.entry.kind == "input":
            effect = Effect(self.entry.name, self.location, dict(self.shape))
            return motion.filtered(motion.of_input(_acting_less(motion.record, model, effect)))[:, None]
        return self.whole_and_columns(motion, model)[1]

    def whole_and_columns(self, motion: BandedMotion, model: Model) -> tuple[FloatArray, FloatArray]:
        """Of a torque that follows from the motion: as it is, before it is filtered, and its `columns`; both
        (n, columns) at the samples that count."""
        variables = variables_of(motion, self.place, self.gives)
        variables.stiffness = model.parameters.get("stiffness", 0.0)
        variables.input = model.parameters["torque_constant"] * motion.input
        variables.inertia = model.parameters["arm_inertia" if self.place == "arm" else "motor_inertia"]
        shared = [] if self.held or self.gives > 0.0 else apart_from_shape(self.entry.name)
        pairs = [self._shared(motion, variables, size) for size in self.sizes if size in shared]
        found = [self._torque(variables, size) for size in self.sizes if size not in shared]
        if self.angle is not None:
            found.append(self._turned(variables))
        if found:
            along = np.column_stack(found)
            pairs.append((along.take(motion.kept, axis=0), motion.filtered(along, times=2)))
        if len(pairs) == 1:
            return pairs[0]
        return np.hstack([whole for whole, _ in pairs]), np.hstack([columns for _, columns in pairs])

    def _shared(
        self, motion: BandedMotion, variables: SimpleNamespace, size: str
    ) -> tuple[FloatArray, FloatArray]:
        """`whole_and_columns` of one size, which all shapes of an effect have alike: computed once."""
        key = f"{self.entry.name}.{size} @ {self.place}"
        if key not in motion.known:
            along = self._torque(variables, size)[:, None]
            columns = motion.filtered(along, times=2)
            motion.known[key] = SimpleNamespace(whole=along[motion.kept], columns=columns)
        return motion.known[key].whole, motion.known[key].columns

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest factor of each column."""
        return self._bounds

    @cached_property
    def _bounds(self) -> tuple[FloatArray, FloatArray]:
        if self.held:
            return np.array([1.0 / _OFF]), np.array([_OFF])
        low = [self.entry.parameter(n).minimum for n in self.sizes]
        if self._turns:
            low[-1] = -math.inf
        low += [-math.inf] * (self.angle is not None)
        return np.where(np.array(low) >= 0.0, 0.0, -np.inf), np.full(len(low), np.inf)

    def ends_at_bound(self, factors: FloatArray) -> bool:
        """Whether a size that is held would have to be another one, at which nothing was evaluated."""
        return self.held and not 1.001 / _OFF < float(factors[0]) < _OFF / 1.001

    @property
    def parameters(self) -> int:
        """How many numbers were sought: those of the columns, and those of the shape."""
        return len(self.bounds()[0]) + (0 if self.held else len(self.shape)) + (self.gives > 0.0)

    def effect(self, factors: FloatArray) -> Effect:
        """The effect with the sizes that the factors of its columns say."""
        values = dict(self.shape)
        if self.held:
            values[self.sizes[0]] *= float(factors[0])
        else:
            values |= dict(zip(self.sizes, map(float, factors), strict=False))
        if self.angle is not None:
            along, across = float(factors[len(self.sizes) - 1]), float(factors[-1])
            if self._turns:
                values[self.sizes[-1]] = math.hypot(along, across)
                values[self.angle] = math.atan2(across, along)
            else:
                values[self.angle] = across / along if along != 0.0 else 0.0
        if self.entry.memory == "ratio":
            values[self.entry.parameters[1].name] = max(values[self.sizes[0]], 1e-12) / self.gives
        return Effect(
            self.entry.name,
            self.location,
            {n: self.entry.parameter(n).within(v) for n, v in values.items()},
        )

    def errors(self, factors: FloatArray, std: FloatArray) -> dict[str, float]:
        """Standard errors of its parameters from those of the factors of its columns; a shape of a grid is
        known to a part of its step."""
        found = {n: _STEP_OF_GRID * abs(v) for n, v in self.shape}
        if self.held:
            return {self.sizes[0]: float(std[0]) * dict(self.shape)[self.sizes[0]]}
        found |= dict(zip(self.sizes, std.tolist(), strict=False))
        if self.angle is not None:
            (a, b), (sa, sb) = factors[-2:], std[-2:]
            length = max(math.hypot(a, b), 1e-300)
            if self._turns:
                found[self.sizes[-1]] = math.hypot(a * sa, b * sb) / length
                found[self.angle] = min(math.hypot(b * sa, a * sb) / length**2, math.pi)
            else:
                found[self.angle] = float(sb) / max(abs(a), 1e-300)
        if self.entry.memory == "ratio":
            name = self.entry.parameters[1].name
            found[name] = 0.5 * max(float(factors[0]), 1e-12) / self.gives
        return found

    @classmethod
    def of(cls, effect: Effect, place: str) -> Hypothesis:
        """A known effect: its one column is its torque, evaluated at the size that it has (`held`). What an
        actuator makes of the input is a torque at the motor."""
        entry, values = effect.entry, effect.values
        place = "motor" if place == "actuator" else place
        gives = 0.0
        if entry.memory in ("ratio", "displacement"):
            first, second = (values[p.name] for p in entry.parameters[:2])
            gives = first / second if entry.memory == "ratio" else second
        size = entry.parameters[0].name
        return cls(entry, effect.location, place, tuple(values.items()), (size,), None, gives, held=True)

    @classmethod
    def resized(cls, effect: Effect, place: str) -> Hypothesis:
        """A known effect whose sizes are sought anew, with its shape as it is; as in `of` where its equation
        is not linear in its size."""
        held, entry = cls.of(effect, place), effect.entry
        sizes, _, angle = parts_of(entry)
        if entry.kind == "input" or not sizes or is_held(entry, sizes):
            return held
        apart = {*sizes, angle, entry.parameters[1].name if entry.memory == "ratio" else None}
        shape = tuple((n, v) for n, v in effect.values.items() if n not in apart)
        return cls(entry, effect.location, held.place, shape, sizes, angle, held.gives)

    @property
    def _turns(self) -> bool:
        """Whether its angle turns sine into cosine; else it shifts."""
        return self.angle is not None and self.entry.parameter(self.angle).turns == "phase"

    def _torque(self, variables: SimpleNamespace, size: str, **more: float) -> FloatArray:
        p = {q.name: 0.0 if q.default is None else q.default for q in self.entry.parameters}
        p |= dict(self.shape) | more
        if not self.held:
            p |= {n: 1.0 if n == size else 0.0 for n in self.sizes}
        if self.entry.kind == "relative_inertia":
            return variables.inertia * inertia_torque(self.entry, variables, SimpleNamespace(**p))
        equation = self.entry.equation
        assert equation is not None
        torque = np.asarray(equation(variables, SimpleNamespace(**p)), dtype=float)
        return np.broadcast_to(torque, variables.position.shape)

    def _turned(self, variables: SimpleNamespace) -> FloatArray:
        size = self.sizes[-1]
        assert self.angle is not None
        if self._turns:
            return self._torque(variables, size, **{self.angle: math.pi / 2})
        return self._torque(variables, size, **{self.angle: 1.0}) - self._torque(variables, size)


def of_actuator(term: Term) -> bool:
    """Whether a term is what an actuator makes of the input."""
    return isinstance(term, Hypothesis) and term.entry.kind == "input"


def _acting_less(record: Record, model: Model, effect: Effect) -> FloatArray:
    """The torque (n,), N·m, that acts on the motor with an effect of the actuator, less that without it."""
    bare = replace(model, effects=(), fixed=())
    acts = [
        acting_torque(pack(one), record.input, record.dt, record.start)
        for one in (replace(bare, effects=(effect,)), bare)
    ]
    return acts[0] - acts[1]


def parts_of(entry: EffectEntry) -> tuple[tuple[str, ...], list[EffectParameter], str | None]:
    """An effect's sizes, the parameters of its shape, and the angle that turns or offsets it."""
    sizes = tuple(p.name for p in entry.parameters if p.default is None and p.neutral == 0.0)
    shaped = [p for p in entry.parameters if p.default is None and p.neutral is None]
    return sizes, shaped, next((p.name for p in entry.parameters if p.turns), None)


def is_held(entry: EffectEntry, sizes: Sequence[str]) -> bool:
    """Whether the equation is not linear in the effect's one size."""
    return len(sizes) == 1 and not linear(entry, sizes[0])
