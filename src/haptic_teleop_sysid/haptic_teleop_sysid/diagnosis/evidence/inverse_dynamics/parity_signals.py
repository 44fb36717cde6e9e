"""What parity equations are of: signals of a recording in the band, and torques that they allow for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.effects import EffectEntry
from haptic_teleop_sim.effects.on_arrays import NUMERIC
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.records import Record, piece

from ...hypotheses.follows import follows_from_motion
from .motion import BRIDGED, BandedMotion, banded, in_long_runs
from .parity_equations import ARM, JOINT, MOTOR, Signals
from .parity_fit import rms
from .regression import STIFFNESS
from .terms import Hypothesis

FloatArray = NDArray[np.float64]

#: Factor by which a stiffness that is fixed may differ from the model's.
_FIXED = 1.1
#: Mean direction of the motion within the filter's reach from which a dry friction slides, and share of the
#: rms velocity below which it may stick: then it is any torque up to its size.
_SLIDES, _STICKS = 0.97, 0.1
#: Correlation with the input from which what an actuator makes of it is a gain.
_GAIN = 0.999


def both_read(record: Record, cutoff: float) -> list[Record]:
    """The stretches of a record without a long hole of either encoder: a response does not go on over one."""
    missing = ~np.all(np.isfinite(record.measured), axis=1)
    holes = in_long_runs(missing, BRIDGED / (cutoff * record.dt))
    edges = np.flatnonzero(np.diff(np.concatenate([[1], holes.astype(np.int8), [1]])))
    return [piece(record, first, stop) for first, stop in edges.reshape(-1, 2).tolist()]


def sticks(effect: Effect) -> bool:
    """Whether an effect is a friction that holds a joint at rest."""
    return effect.entry.memory == "direction"


def signals(
    model: Model, record: Record, cutoff: float, known: Sequence[Effect], sliding: Sequence[Effect] = ()
) -> Signals:
    counting = banded(record, False, cutoff)
    every = np.arange(len(counting.time))
    motion = replace(counting, kept=every, block=1, known={})
    torques: dict[str, list[FloatArray]] = {MOTOR: [], ARM: [], JOINT: []}
    slides = np.ones(len(every), dtype=bool)
    for effect in known:
        place = acts_at(model, effect.location)
        torques[place].append(_columns(effect, place, motion, model))
    for place in {acts_at(model, effect.location) for effect in (*known, *sliding) if sticks(effect)}:
        velocity = motion.velocity[:, int(place == ARM)]
        moves = np.clip(velocity / (_STICKS * rms([velocity])), -1.0, 1.0)
        slides &= np.abs(motion.filtered(moves, 2)) > _SLIDES
    within = _FIXED if "stiffness" in model.fixed else STIFFNESS
    stiffness = model.parameters["stiffness"]
    return Signals(
        model.parameters["torque_constant"] * motion.filtered(motion.input),
        motion.filtered(motion.angle),
        motion.filtered(motion.velocity),
        motion.filtered(motion.acceleration),
        {place: np.hstack([np.zeros((len(every), 0)), *found]) for place, found in torques.items()},
        (stiffness / within, stiffness * within),
        counting.kept[slides[counting.kept]],
        motion.dt,
    )


def acts_at(model: Model, location: str) -> str:
    """The place at which what sits at a location enters the equations: what an actuator makes of its input is
    a torque at the motor."""
    place = model.place(location)
    return MOTOR if place == "actuator" else place


def can_allow_for(entry: EffectEntry) -> bool:
    """Whether parity equations can allow for an effect: a torque along the motion, a change of a friction, or
    what an actuator makes of its input."""
    return follows_from_motion(entry) or entry.kind in ("input", "friction_factor")


def _columns(effect: Effect, place: str, motion: BandedMotion, model: Model) -> FloatArray:
    """Torques (n, columns) of such an effect, by size, filtered like the input. None of a gain: all
    inertias, dampings and stiffnesses share it, and no equation holds the better for it."""
    if effect.entry.kind == "input":
        columns = Hypothesis.of(effect, place).columns(motion, model)
        given = motion.filtered(motion.input)
        product = np.linalg.norm(columns) * np.linalg.norm(given)
        return columns[:, : int(abs(float(columns[:, 0] @ given)) < _GAIN * product)]
    if effect.entry.kind != "friction_factor":
        return Hypothesis.resized(effect, place).columns(motion, model)
    equation = effect.entry.equation
    assert equation is not None
    at = SimpleNamespace(time=motion.time, **NUMERIC)
    factor = np.asarray(equation(at, SimpleNamespace(**effect.values)), dtype=float)
    velocity = motion.velocity[:, int(place == "arm")]
    return motion.filtered((factor - 1.0) * velocity)[:, None]
