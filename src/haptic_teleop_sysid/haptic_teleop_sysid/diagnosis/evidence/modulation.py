"""Does a found effect keep its size whatever else the joint does?

Friction that grows with the speed of another axis wins as dry friction against all names, with the mean of
what it is. Were its torque larger by the factor 1 + c z(t), the innovations would answer that, as long as
z changes slowly against the observer, by c z(t) times what they answer to the whole effect:

    e = e0 + c z (de/ds),   s a common factor of all the effect's sizes,

so that c is a score test (Rao 1948) away, all free parameters projected out. Of an effect under its right
name both kinds of recordings agree on no c (see `changing_size`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import FAILURES, channels, innovations, settling
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.whitening import whiten

FloatArray = NDArray[np.float64]

#: Share of the rms velocity below which a joint rests, the time of its motion that this rest may still matter
#: for, and the longest rest that does more than a shorter one, s.
AT_REST, JUST_AFTER, LONGEST_REST = 0.05, 0.02, 0.3
RESTED = "time at rest before the motion"
#: Least share and nats where they are not what `changes_with` is told: what happens for moments only changes
#: the mean little. Of 14 frictions of d' 33 to 557 that were named right on a seed of the benchmark none
#: gained more than two nats; friction that ages at rest (d' 113 and 498), 22 and 94 on both kinds.
OWN_LIMITS = {RESTED: (0.01, 12.0)}


@dataclass(frozen=True)
class Modulation:
    """``share``: change of the effect's size, relative, per standard deviation of what it would change with;
    ``gain``: nats that this gains."""

    share: float
    gain: float


def modulations(fit: Fit, effect: Effect, records: Sequence[Record]) -> dict[str, Modulation]:
    """How the size of an effect that ``fit`` found would change, by what with (in words); {} where it has no
    size, or where the arithmetic fails."""
    sizes = _sizes(fit.model, effect, fit.free)
    if not sizes or not np.isfinite(fit.log_likelihood):
        return {}
    packed = pack(fit.model)
    sums: dict[str, FloatArray] = {}
    for record in records:
        try:
            run = innovations(packed, fit.noise, record, fit.free)
            errors, slopes = whiten(packed, record, run.innovation, run.d_innovation)
        except FAILURES:
            return {}
        length = np.sqrt(np.sum(slopes**2, axis=0))
        known = np.linalg.qr(slopes[:, length > 0.0] / length[length > 0.0])[0]
        whole = sum(size * slopes[:, fit.free.index(name)] for name, size in sizes.items())
        weights = whole**2
        if not np.sum(weights) > 0.0:
            continue
        for name, z in _quantities(fit.model, effect, record, run.states):
            # Of the sample before: a controller's input has the noise of this sample's readings in it.
            before = np.concatenate([z[:1], z[:-1]])
            values = np.repeat(before[settling(record) :], len(channels(packed, record)))
            away = values - np.average(values, weights=weights)
            spread = np.sqrt(np.average(away**2, weights=weights))
            if not spread > 1e-9:
                continue
            column = whole * away / spread
            column -= known @ (known.T @ column)
            now = np.array([column @ column, -(column @ errors)])
            sums[name] = sums.get(name, np.zeros(2)) + now
    return {
        name: Modulation(float(score / size), float(0.5 * score**2 / size))
        for name, (size, score) in sums.items()
        if size > 0.0
    }


def changes_with(
    here: dict[str, Modulation], elsewhere: dict[str, Modulation], share: float, gain: float
) -> list[tuple[str, float]]:
    """What the size changes with on both kinds of recordings, by more than ``share`` and with more than
    ``gain`` nats each, and by how much, the surest first."""
    found = []
    for name, a in here.items():
        b = elsewhere.get(name)
        least_share, least_gain = OWN_LIMITS.get(name, (share, gain))
        if (
            b is not None
            and min(a.gain, b.gain) > least_gain
            and min(abs(a.share), abs(b.share)) > least_share
            and a.share * b.share > 0.0
        ):
            found.append((min(a.gain, b.gain), name, a.share))
    return [(name, by) for _, name, by in sorted(found, reverse=True)]


def rested(velocity: FloatArray, dt: float) -> FloatArray:
    """How long, s, a joint has rested just before it moves, (n,), for the first JUST_AFTER s of the motion,
    and zero elsewhere; ``velocity`` (n,), rad/s. Longer rests than LONGEST_REST count as that."""
    slow = np.abs(velocity) < AT_REST * np.sqrt(np.mean(velocity**2))
    edges = np.diff(slow.astype(np.int8), prepend=0)
    stops, starts = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    found = np.zeros(len(velocity))
    for stop, start in zip(stops, starts, strict=False):
        moving = slice(start, start + max(round(JUST_AFTER / dt), 1))
        found[moving] = min((start - stop) * dt, LONGEST_REST)
    return np.where(slow, 0.0, found)


def _sizes(model: Model, effect: Effect, free: Sequence[str]) -> dict[str, float]:
    """The effect's free sizes, as differences from where there is none."""
    head = f"{effect.location}.{effect.effect}."
    values = model.parameter_values()
    return {
        head + p.name: values[head + p.name] - p.neutral
        for p in effect.entry.parameters
        if p.default is None and p.neutral is not None and np.isfinite(p.neutral) and head + p.name in free
    }


def _quantities(
    model: Model, effect: Effect, record: Record, states: FloatArray
) -> Iterator[tuple[str, FloatArray]]:
    """What a size may change with (n,), by name; angles and velocities at the effect's own place."""
    part = "arm" if model.place(effect.location).startswith("arm") else "motor"
    side = int(part == "arm")
    time: FloatArray = record.dt * np.arange(len(record), dtype=np.float64)
    velocity = states[:, 2 + side]
    yield "time", time
    yield f"{part} angle", states[:, side]
    yield f"direction of {part} velocity", np.sign(velocity)
    yield f"size of {part} velocity", np.abs(velocity)
    if effect.entry.kind == "friction":
        yield RESTED, rested(velocity, record.dt)
    if not model.rigid:
        deflection = states[:, 0] - states[:, 1]
        yield "deflection", deflection
        yield "size of the deflection", np.abs(deflection)
    yield "size of the input", np.abs(record.input)
    if np.any(record.exogenous):
        speed = np.cumsum(record.exogenous) * record.dt
        yield "speed of the other stage", np.abs(speed - np.mean(speed))
