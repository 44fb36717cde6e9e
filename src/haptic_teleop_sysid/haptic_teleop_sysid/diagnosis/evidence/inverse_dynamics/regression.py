"""Least squares on a joint's equations of motion, in the band of the motion.

    motor:  J_m a_m + b_m v_m + k (q_m - q_a) - sum of effects = K u
    arm:    J_a a_a + b_a v_a - k (q_m - q_a) - sum of effects = 0

linear in the parameters (Swevers, Verdonck and De Schutter, IEEE Control Systems 27(5), 2007). Where the
stiffness k is estimated, the arm's equation has no scale of its own (nothing multiplies nothing): it is
written in units of the given stiffness, k0 (q_m - q_a) on the right, and what it yields is scaled by k / k0
afterwards. Angles, and everything that is computed from them, go through the filter that the input goes
through, so that no term is late or larger than another. Encoder noise in the accelerations biases inertias
where the loop is closed and the noise is strong; below the resolution, and of sensors and delays, it sees
nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.model import STRUCTURES, Model
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.simulation.covariance import deviations, sandwich, score_covariance

from ...hypotheses.follows import follows_from_motion
from ...inputs.scales import within_reach
from .band import long_enough
from .kept import Kept
from .motion import BandedMotion, banded
from .term import Term
from .terms import Hypothesis

FloatArray = NDArray[np.float64]
One = TypeVar("One", bound=Term)

#: Factor by which a stiffness may differ from the given one: with little deflection it is hardly seen.
STIFFNESS = 3.0


@dataclass(frozen=True)
class Equations:
    """The equations of some recordings, one row a sample: ``target`` (n, equations) = ``base`` (equations, n,
    p) parameters + effects, motor first; ``names`` (p,) of the free parameters of the structure; ``motions``:
    one a recording."""

    model: Model
    motions: tuple[BandedMotion, ...]
    names: tuple[str, ...]
    target: FloatArray
    base: FloatArray
    _known: Kept = field(default_factory=Kept, compare=False)

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest value of the structure's parameters, (p,) each."""
        return self._bounds

    @cached_property
    def _bounds(self) -> tuple[FloatArray, FloatArray]:
        reach = within_reach(self.model)
        given = self.model.parameters["stiffness"] if "stiffness" in self.names else 0.0
        found = [
            (given / STIFFNESS, given * STIFFNESS) if name == "stiffness" else reach[name]
            for name in self.names
        ]
        return np.array([low for low, _ in found]), np.array([high for _, high in found])

    def arm_scale(self, values: FloatArray) -> float:
        """k / k0 of a solution: what the arm's parameters and effects are to be multiplied by."""
        if "stiffness" not in self.names:
            return 1.0
        return float(values[self.names.index("stiffness")]) / self.model.parameters["stiffness"]

    @property
    def samples(self) -> int:
        """Rows of one equation."""
        return len(self.target)

    def torque(self, term: Term) -> FloatArray:
        """Torques (n, columns) of an effect or of a free curve, by unit size."""
        return self._known.of(
            term, lambda: np.concatenate([term.columns(m, self.model) for m in self.motions])
        )

    def forget(self, terms: Iterable[Term]) -> None:
        """Free the torques of terms that are not asked for again."""
        for term in terms:
            self._known.drop(term)

    def seen(self, term: Hypothesis) -> float:
        """Share of an effect's torque (mean square) that lies in the band, of the column of which least does;
        1 for an actuator's, of which the band has what it has of the input.

        A ripple of a high order turns many times within a period of the cut-off: what is left of it in the
        band is an accident of where the motion slows down, and of how exactly the angle is known."""
        if term.entry.kind == "input":
            return 1.0
        found = [term.whole_and_columns(m, self.model) for m in self.motions]
        whole, columns = (np.concatenate([pair[i] for pair in found]) for i in (0, 1))
        self._known.put(term, columns)  # whoever asks what is seen of a torque asks for the torque next
        inside, whole = (np.einsum("ij,ij->j", side, side) for side in (columns, whole))
        return float(np.min(inside / np.maximum(whole, 1e-300)))

    def largest(self, chosen: Sequence[Hypothesis], values: FloatArray) -> float:
        """Largest torque (rms) of one of a group's effects, with the factors ``values`` of all columns."""
        torques = (self.torque(term) @ values[own] for term, own in own_columns(self.names, chosen))
        return max((float(np.sqrt(np.mean(torque**2))) for torque in torques), default=0.0)

    @cached_property
    def driven(self) -> FloatArray:
        """Torque (n,) of the input in the band."""
        input = np.concatenate([m.filtered(m.input) for m in self.motions])
        return self.model.parameters["torque_constant"] * input

    def acting(self, term: Hypothesis) -> float:
        """Mean square of the input torque that acts with an effect of the actuator, as a share of that which
        acts without it; 1 for what takes nothing from the input."""
        if term.entry.kind != "input":
            return 1.0
        given = self.driven
        acts = given + self.torque(term)[:, 0]
        return float(acts @ acts) / max(float(given @ given), 1e-300)


def own_columns(names: Sequence[str], chosen: Sequence[One]) -> Iterator[tuple[One, slice]]:
    """Each term of a group with its columns, which come after those of the structure's parameters."""
    place = len(names)
    for one in chosen:
        yield one, slice(place, place := place + len(one.bounds()[0]))


def signs(place: str, rigid: bool) -> tuple[float, ...]:
    """With which sign an added torque stands on the left-hand side of each equation."""
    if rigid:
        return (-1.0,)
    return {"motor": (-1.0, 0.0), "arm": (0.0, -1.0), "joint": (1.0, -1.0)}[place]


def equations(model: Model, records: Sequence[Record], cutoff: float) -> Equations:
    """The equations of a model's joint along recordings that are `long_enough`, filtered at ``cutoff``, Hz;
    the model's own effects count as known as far as they are torques along the motion. ValueError where no
    sample counts."""
    motions = tuple(banded(r, model.rigid, cutoff) for r in long_enough(records, cutoff))
    if not any(len(m.kept) for m in motions):
        raise ValueError(f"no sample of these recordings counts at {cutoff:.3g} Hz")

    def along(pick: Callable[[BandedMotion], FloatArray]) -> FloatArray:
        return np.concatenate([m.filtered(pick(m)) for m in motions])

    def column(torque: FloatArray, place: str) -> FloatArray:
        """(n, equations), of a torque (n,) that the motion takes at a place."""
        return -torque[:, None] * np.array(signs(place, model.rigid))

    terms = {
        "torque_constant": -column(along(lambda m: m.input), "motor"),
        "motor_inertia": column(along(lambda m: m.acceleration[:, 0]), "motor"),
        "motor_damping": column(along(lambda m: m.velocity[:, 0]), "motor"),
    }
    if not model.rigid:
        terms |= {
            "arm_inertia": column(along(lambda m: m.acceleration[:, 1]), "arm"),
            "arm_damping": column(along(lambda m: m.velocity[:, 1]), "arm"),
            "stiffness": -column(along(lambda m: m.angle[:, 0] - m.angle[:, 1]), "joint"),
        }
    names = [n for n in STRUCTURES[model.structure] if n not in model.fixed]
    if "torque_constant" in names and "stiffness" not in model.fixed:
        names.remove("torque_constant")  # only one scale of all torques can be found
    target = np.zeros_like(terms["torque_constant"])
    stiffness = model.parameters.get("stiffness", 0.0)
    for effect in model.effects:
        if follows_from_motion(effect.entry):
            own = Hypothesis.of(effect, model.place(effect.location))
            torque = np.concatenate([own.columns(m, model) for m in motions])
            target += column(torque[:, 0], own.place)
    for name, known in terms.items():
        if name not in names:
            target -= model.parameters[name] * known
    if "stiffness" in names:
        target[:, 1] -= stiffness * terms["stiffness"][:, 1]
        terms["stiffness"][:, 1] = 0.0
    base = np.zeros((target.shape[1], len(target), len(names)))
    for i, name in enumerate(names):
        base[:, :, i] = terms[name].T
    return Equations(model, motions, tuple(names), target, base)


def standard_errors(columns: FloatArray, left: FloatArray, lags: int) -> FloatArray:
    """(p,) standard errors with errors correlated over ``lags`` rows (Newey and West 1987)."""
    information = columns.T @ columns
    meat = score_covariance(columns * left[:, None], lags)
    return deviations(sandwich(information, meat))
