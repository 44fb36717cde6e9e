"""What is left over: the disturbance torques that the observer needs to follow a recording, and what they
depend on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import after_settling, channels, innovations
from haptic_teleop_sysid.estimation.records import Record

from ..inputs.scales import bridged, velocity_of

FloatArray = NDArray[np.float64]
_BINS = 24


@dataclass(frozen=True)
class Condition:
    """How far the left-over torque of one equation follows one quantity.

    ``explained``: share of its variance on recordings that were not used to draw the curve; ``centre``
    (bins,), ``torque`` (bins,): the curve, in ``unit`` and N·m.
    """

    equation: str
    name: str
    unit: str
    explained: float
    centre: FloatArray
    torque: FloatArray

    @property
    def size(self) -> float:
        """Rms of the curve, N·m."""
        return float(np.sqrt(np.mean(self.torque**2))) if len(self.torque) else 0.0


@dataclass(frozen=True)
class LeftOver:
    """Left-over torque of one recording: time (n,) s, torque (n, 2) N·m at motor and arm, and the quantities
    that it may depend on, by name (n,); ``read`` (n,): where all encoders that take part were read.
    """

    time: FloatArray
    torque: FloatArray
    quantities: dict[str, FloatArray]
    read: NDArray[np.bool_]


INPUT_TORQUE = "input torque"
UNITS = {
    "motor velocity": "rad/s",
    "motor angle": "rad",
    "arm velocity": "rad/s",
    "arm angle": "rad",
    "deflection": "rad",
    "rate of deflection": "rad/s",
    INPUT_TORQUE: "N*m",
    "time": "s",
}


def left_over(fit: Fit, record: Record) -> LeftOver:
    """The torques that the observer of a fitted model adds to follow a recording."""
    packed = pack(fit.model)
    states = innovations(packed, fit.noise, record).states
    used = [0, channels(packed, record)[-1]]
    q = np.column_stack([bridged(record.measured[:, c]) for c in used])
    read = np.logical_and(*(np.isfinite(record.measured[:, c]) for c in used))
    vm, va = velocity_of(q[:, 0], record.dt), velocity_of(q[:, 1], record.dt)
    time = record.dt * np.arange(len(record), dtype=np.float64)
    quantities = {
        "motor velocity": vm,
        "motor angle": q[:, 0],
        "time": time,
        INPUT_TORQUE: record.input * packed.torque_constant,
    }
    if not packed.rigid:
        quantities |= {
            "arm velocity": va,
            "arm angle": q[:, 1],
            "deflection": q[:, 0] - q[:, 1],
            "rate of deflection": vm - va,
        }
    return LeftOver(time, states[:, -2:], quantities, read)


def conditions(
    fit: Fit, estimation: Sequence[Record], validation: Sequence[Record], joint: str
) -> list[Condition]:
    """What the left-over torques depend on, the strongest first.

    A curve of means over bins is drawn from the estimation recordings and judged on the validation
    recordings, where both have data (Kerschen et al. 2006 call it the restoring-force surface).  Time is
    left out, because times of two recordings have nothing to do with each other.
    """
    learn = [left_over(fit, r) for r in estimation]
    judge = [left_over(fit, r) for r in validation]
    result = []
    equations = [f"{joint}_motor"] if fit.model.rigid else [f"{joint}_motor", f"{joint}_arm"]
    for channel, equation in enumerate(equations):
        for name in learn[0].quantities:
            if name == "time":
                continue
            result.append(
                _condition(
                    equation,
                    name,
                    _pooled(learn, estimation, name, channel),
                    _pooled(judge, validation, name, channel),
                )
            )
    return sorted(result, key=lambda c: -c.explained)


def _pooled(
    parts: Sequence[LeftOver], records: Sequence[Record], name: str, channel: int
) -> tuple[FloatArray, FloatArray]:
    read = np.concatenate([after_settling(r, p.read) for p, r in zip(parts, records, strict=True)])
    x = np.concatenate([after_settling(r, p.quantities[name]) for p, r in zip(parts, records, strict=True)])
    y = np.concatenate([after_settling(r, p.torque[:, channel]) for p, r in zip(parts, records, strict=True)])
    return x[read], y[read]


def _condition(
    equation: str, name: str, learn: tuple[FloatArray, FloatArray], judge: tuple[FloatArray, FloatArray]
) -> Condition:
    x, y = learn
    edges = np.unique(np.quantile(x, np.linspace(0.0, 1.0, _BINS + 1)))
    if len(edges) < 4:
        return Condition(equation, name, UNITS[name], 0.0, np.zeros(0), np.zeros(0))
    index = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, len(edges) - 2)
    count = np.maximum(np.bincount(index, minlength=len(edges) - 1), 1)
    torque = np.bincount(index, y, minlength=len(edges) - 1) / count
    centre = np.bincount(index, x, minlength=len(edges) - 1) / count
    xv, yv = judge
    inside = (xv >= edges[0]) & (xv <= edges[-1])
    explained = 0.0
    if np.sum(inside) > 100:
        y_in = yv[inside]
        # An observer that overflows leaves a torque whose square has no size: nothing explains it.
        with np.errstate(over="ignore", invalid="ignore"):
            left = y_in - np.interp(xv[inside], centre, torque)
            ratio = float(np.mean(left**2) / max(np.mean(y_in**2), 1e-30))
        explained = 1.0 - ratio if np.isfinite(ratio) else 0.0
    return Condition(equation, name, UNITS[name], explained, centre, torque)


def shares(fit: Fit, records: Sequence[Record]) -> dict[str, float]:
    """Shares of the left-over torque's power by place: motor, arm, joint; they add up to one.

    A torque in the joint acts on both equations, as much on the one as against the other: what they have in
    common with opposite signs is the joint's, what is left is each equation's own."""
    if fit.model.rigid:
        return {"motor": 1.0}
    power = np.zeros((2, 2))
    for r in records:
        torque = after_settling(r, left_over(fit, r).torque)
        power += torque.T @ torque / len(torque)
    opposite = float(np.clip(-power[0, 1], 0.0, min(power[0, 0], power[1, 1])))
    found = {
        "motor": float(power[0, 0]) - opposite,
        "arm": float(power[1, 1]) - opposite,
        "joint": 2.0 * opposite,
    }
    total = sum(found.values())
    return {n: v / total if total > 0.0 else 1.0 / len(found) for n, v in found.items()}


def intervals(before: Fit, after: Fit, record: Record, seconds: float = 0.5) -> list[tuple[float, float]]:
    """When the mismatch showed: stretches (start, end), s, in which prediction errors shrank by far more than
    on average; empty when it shows throughout.
    """

    def energy(fit: Fit) -> FloatArray:
        e = innovations(pack(fit.model), fit.noise, record).innovation
        return np.sum((e / np.array(record.resolution)) ** 2, axis=1)

    gain = energy(before) - energy(after)
    size = max(1, round(seconds / record.dt))
    blocks = np.add.reduceat(gain, np.arange(0, len(gain), size))
    total = float(np.sum(np.maximum(blocks, 0.0)))
    if total <= 0.0:
        return []
    strong = blocks > 3.0 * total / len(blocks)
    found: list[tuple[float, float]] = []
    for i in np.flatnonzero(strong):
        start, end = i * size * record.dt, min((i + 1) * size, len(gain)) * record.dt
        if found and start - found[-1][1] < 1e-9:
            found[-1] = (found[-1][0], end)
        else:
            found.append((start, end))
    return [(round(float(a), 3), round(float(b), 3)) for a, b in found]
