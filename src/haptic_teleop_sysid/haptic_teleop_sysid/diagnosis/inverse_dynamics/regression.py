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

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from haptic_teleop_sim.model import STRUCTURES, Model
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.scores import score_covariance

from ..scales import within_reach
from .latent import Latent
from .motion import BandedMotion, banded
from .terms import Hypothesis, follows_from_motion

FloatArray = NDArray[np.float64]

#: Factor by which a stiffness may differ from the given one: with little deflection it is hardly seen.
STIFFNESS = 3.0
#: Stretches into which recordings are cut for folds.
STRETCHES = 16


@dataclass(frozen=True)
class Equations:
    """The equations of some recordings, one row a sample and equation: ``target`` (m,) = ``base`` (m, p)
    parameters + effects, motor's rows first; ``names`` (p,) of the free parameters of the structure;
    ``motions``: one a recording."""

    model: Model
    motions: tuple[BandedMotion, ...]
    names: tuple[str, ...]
    target: FloatArray
    base: FloatArray

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest value of the structure's parameters, (p,) each."""
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
        return sum(len(m.kept) for m in self.motions)

    def columns(self, hypothesis: Hypothesis | Latent) -> FloatArray:
        """(m, columns): what the hypothesis contributes to the left-hand side, by unit size."""
        stiffness = self.model.parameters.get("stiffness", 0.0)
        torque = np.concatenate([hypothesis.columns(m, stiffness) for m in self.motions])
        return placed(torque, hypothesis.place, self.model.rigid)


@dataclass(frozen=True)
class Fold:
    """Every other stretch of some recordings' equations together: what `Equations` has, of these rows."""

    parts: tuple[Equations, ...]
    odd: bool

    @property
    def model(self) -> Model:
        return self.parts[0].model

    @property
    def motions(self) -> tuple[BandedMotion, ...]:
        return tuple(m for part in self.parts for m in part.motions)

    @property
    def names(self) -> tuple[str, ...]:
        return self.parts[0].names

    @property
    def samples(self) -> int:
        return int(sum(np.sum(self._taken(part)) for part in self.parts))

    @property
    def target(self) -> FloatArray:
        return self._rows([part.target[:, None] for part in self.parts])[:, 0]

    @property
    def base(self) -> FloatArray:
        return self._rows([part.base for part in self.parts])

    def columns(self, hypothesis: Hypothesis | Latent) -> FloatArray:
        """See `Equations.columns`."""
        return self._rows([part.columns(hypothesis) for part in self.parts])

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """See `Equations.bounds`."""
        return self.parts[0].bounds()

    def arm_scale(self, values: FloatArray) -> float:
        """See `Equations.arm_scale`."""
        return self.parts[0].arm_scale(values)

    def _taken(self, part: Equations) -> NDArray[np.bool_]:
        stretch = np.arange(part.samples) * STRETCHES // max(part.samples, 1)
        return stretch % 2 == int(self.odd)

    def _rows(self, values: Sequence[FloatArray]) -> FloatArray:
        """Rows (m, ...) of the parts' (m, ...), the motor's equation of all parts first."""
        count = 1 if self.model.rigid else 2
        halves = [np.split(v, count) for v in values]
        taken = [self._taken(part) for part in self.parts]
        return np.concatenate([h[k][t] for k in range(count) for h, t in zip(halves, taken, strict=True)])


def placed(torque: FloatArray, place: str, rigid: bool) -> FloatArray:
    """Columns (n, c) of an added torque as rows (n or 2 n, c) of the left-hand sides."""
    if rigid:
        return -torque
    nothing = np.zeros_like(torque)
    if place == "joint":
        return np.concatenate([torque, -torque])
    return np.concatenate([nothing, -torque] if place == "arm" else [-torque, nothing])


def equations(model: Model, records: Sequence[Record], cutoff: float) -> Equations:
    """The equations of a model's joint along recordings, filtered at ``cutoff``, Hz; the model's own effects
    count as known as far as they are torques along the motion."""
    motions = tuple(banded(r, model.rigid, cutoff) for r in records)

    def rows(pick, place: str) -> FloatArray:
        column = np.concatenate([m.filtered(pick(m)) for m in motions])[:, None]
        return -placed(column, place, model.rigid)[:, 0]

    terms = {
        "torque_constant": -rows(lambda m: m.input, "motor"),
        "motor_inertia": rows(lambda m: m.acceleration[:, 0], "motor"),
        "motor_damping": rows(lambda m: m.velocity[:, 0], "motor"),
    }
    if not model.rigid:
        deflection = np.concatenate([m.filtered(m.angle[:, 0] - m.angle[:, 1]) for m in motions])[:, None]
        terms |= {
            "arm_inertia": rows(lambda m: m.acceleration[:, 1], "arm"),
            "arm_damping": rows(lambda m: m.velocity[:, 1], "arm"),
            "stiffness": placed(deflection, "joint", False)[:, 0],
        }
    names = [n for n in STRUCTURES[model.structure] if n not in model.fixed]
    if "torque_constant" in names and "stiffness" not in model.fixed:
        names.remove("torque_constant")  # only one scale of all torques can be found
    target = np.zeros(len(terms["torque_constant"]))
    for effect in model.effects:
        if follows_from_motion(effect.entry):
            own = Hypothesis.of(effect, model.place(effect.location))
            torque = np.concatenate([own.columns(m, model.parameters.get("stiffness", 0.0)) for m in motions])
            target = target - placed(torque, own.place, model.rigid)[:, 0]
    for name, column in terms.items():
        if name not in names:
            target = target - model.parameters[name] * column
    if "stiffness" in names:
        half = len(target) // 2
        target[half:] -= model.parameters["stiffness"] * terms["stiffness"][half:]
        terms["stiffness"][half:] = 0.0
    base = np.array([terms[n] for n in names]).reshape(len(names), len(target)).T
    return Equations(model, motions, tuple(names), target, base)


def weights_of(target: FloatArray, base: FloatArray, equations_count: int) -> FloatArray:
    """(m,) one over the standard deviation that the base leaves of each equation."""
    left = target - base @ np.linalg.lstsq(base, target, rcond=None)[0] if base.shape[1] else target
    parts = np.split(left, equations_count)
    return np.repeat([1.0 / max(float(np.std(part)), 1e-300) for part in parts], len(left) // equations_count)


def solved(columns: FloatArray, target: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Least squares (p,) within bounds; scaled, so that units do not matter."""
    if not columns.shape[1]:
        return np.zeros(0)
    scale = np.linalg.norm(columns, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    q, r = np.linalg.qr(columns / scale)
    free = np.linalg.lstsq(r, q.T @ target, rcond=1e-10)[0] / scale
    if np.all(free >= low) and np.all(free <= high):
        return free
    found = lsq_linear(r, q.T @ target, bounds=(low * scale, high * scale), method="bvls")
    return np.asarray(found.x, dtype=np.float64) / scale


def standard_errors(columns: FloatArray, left: FloatArray, lags: int) -> FloatArray:
    """(p,) standard errors with errors correlated over ``lags`` rows (Newey and West 1987)."""
    information = columns.T @ columns
    meat = score_covariance(columns * left[:, None], lags)
    inverse = np.linalg.pinv(information, hermitian=True)
    return np.sqrt(np.maximum(np.diag(inverse @ meat @ inverse), 0.0))
