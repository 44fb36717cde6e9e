"""The torque that one effect adds along a recorded motion, what the equations of motion lack there, and the
quantity that the effect follows, as its entry says.

All of it lies in the band of the motion (`inverse_dynamics`): no observer takes part, and no response is
simulated.  Law and quantity go through the same filter, so that corners are as round as those of what lacks.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.effects import EffectEntry
from haptic_teleop_sim.effects.on_arrays import NUMERIC
from haptic_teleop_sim.model import Effect, Model

from ..evidence.inverse_dynamics.motion import BandedMotion
from ..evidence.inverse_dynamics.terms import Hypothesis
from ..evidence.residual import UNITS
from ..hypotheses.along_motion import inertia_torque
from ..hypotheses.follows import follows_from_motion

FloatArray = NDArray[np.float64]

TIME, INPUT, INPUT_RATE = "time", "input torque", "rate of the input torque"
"""Quantities beside angles and speeds that an effect may follow."""
#: Kinds of effects that change another term of the equation: all friction at a place, or its inertia.
_CHANGES = ("friction_factor", "inertia")
_BY_ENTRY = {"time": TIME, "input": INPUT, "input rate": INPUT_RATE, "deflection": "deflection"}
"""Of these the quantities that are of no place, by `EffectEntry.follows`."""


def has_law(effect: Effect) -> bool:
    """Whether the effect is a torque that follows from motion, time or input at each moment."""
    entry = effect.entry
    return follows_from_motion(entry) or entry.kind in ("input", *_CHANGES) or _of_input(entry)


def _of_input(entry: EffectEntry) -> bool:
    """Whether it is a torque of an actuator that its equation gives from input and speed."""
    return entry.kind == "torque" and entry.where == ("actuator",) and entry.equation is not None


def quantity(effect: Effect) -> tuple[str, str]:
    """What an effect's torque follows, and the unit of that."""
    follows, place = effect.entry.follows, place_of(effect)
    if follows in _BY_ENTRY:
        name = _BY_ENTRY[follows]
    elif place == "joint":
        name = "rate of deflection"
    else:
        name = f"{place} {follows}"
    return name, (UNITS | {INPUT_RATE: "N*m/s"})[name]


def followed(motion: BandedMotion, name: str, model: Model) -> FloatArray:
    """The quantity (n,) that a law follows, at the samples that count."""
    if name == TIME:
        return motion.time[motion.kept]
    drive = model.parameters["torque_constant"] * motion.input
    if name == INPUT:
        return motion.filtered(drive)
    if name == INPUT_RATE:
        return motion.filtered(np.gradient(drive, motion.dt))
    q, v = motion.angle, motion.velocity
    values = {
        "motor angle": q[:, 0],
        "arm angle": q[:, 1],
        "motor velocity": v[:, 0],
        "arm velocity": v[:, 1],
        "deflection": q[:, 0] - q[:, 1],
        "rate of deflection": v[:, 0] - v[:, 1],
    }
    return motion.filtered(values[name])


def law_torque(effect: Effect, effects: Sequence[Effect], motion: BandedMotion, model: Model) -> FloatArray:
    """The torque (n,), N·m, that an effect adds at the samples that count; ``effects``: all that the model
    has, of which a change of friction needs those at its place."""
    entry, place = effect.entry, place_of(effect)
    if entry.kind not in _CHANGES and not _of_input(entry):
        return Hypothesis.of(effect, place).columns(motion, model)[:, 0]
    channel = int(on_arm(effect))
    here = SimpleNamespace(
        position=motion.angle[:, channel],
        velocity=motion.velocity[:, channel],
        acceleration=motion.acceleration[:, channel],
        time=motion.time,
        input=model.parameters["torque_constant"] * motion.input,
        **NUMERIC,
    )
    sizes = SimpleNamespace(**effect.values)
    if entry.kind == "inertia":
        return motion.filtered(inertia_torque(entry, here, sizes), times=2)
    equation = entry.equation
    assert equation is not None
    value = np.broadcast_to(np.asarray(equation(copy(here), sizes), dtype=float), motion.time.shape)
    if entry.kind != "friction_factor":
        return motion.filtered(value, times=2)
    damping = model.parameters[f"{'arm' if channel else 'motor'}_damping"]
    friction = motion.filtered(-damping * here.velocity)
    rubbing = [e for e in effects if e.entry.kind == "friction" and place_of(e) == place]
    friction = friction + sum(law_torque(e, effects, motion, model) for e in rubbing)
    return (value[motion.kept] - 1.0) * friction


def lacking(model: Model, motion: BandedMotion, arm: bool) -> FloatArray:
    """What one equation of motion lacks (n,), N·m, at the samples that count: what its effects have to
    add."""
    p, channel = model.parameters, int(arm)
    elastic = 0.0 if model.rigid else p["stiffness"] * (motion.angle[:, 0] - motion.angle[:, 1])
    a, v = motion.acceleration[:, channel], motion.velocity[:, channel]
    if arm:
        return motion.filtered(p["arm_inertia"] * a + p["arm_damping"] * v - elastic)
    drive = p["torque_constant"] * motion.input
    return motion.filtered(p["motor_inertia"] * a + p["motor_damping"] * v + elastic - drive)


def place_of(effect: Effect) -> str:
    """motor | arm | joint: where its torque acts."""
    place = effect.location.rpartition("_")[2]
    return "motor" if place == "actuator" else place


def on_arm(effect: Effect) -> bool:
    """Whether the effect is told from the arm's equation of motion: the joint's are, too."""
    return place_of(effect) in ("arm", "joint")
