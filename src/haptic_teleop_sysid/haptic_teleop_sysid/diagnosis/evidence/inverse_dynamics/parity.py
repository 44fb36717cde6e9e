"""Where in a flexible joint does something act? Parity equations (Chow and Willsky, IEEE TAC 29, 1984).

    motor:  K u = J_m a_m + b_m v_m + k (q_m - q_a)      arm:  k (q_m - q_a) = J_a a_a + b_a v_a

One unknown signal enters them by its place alone. What eliminates it is one equation, which holds whatever
the signal is: the arm's for a torque at the motor, the motor's for one at the arm, the sum of both for one in
the joint, and for the error of an encoder what is left without that encoder. Only the equation of the right
place holds. No name, and no model of noise, is asked for; with unknown signals at two places none holds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import scipy
from numpy.typing import NDArray

from haptic_teleop_sim.effects import EffectEntry
from haptic_teleop_sim.effects.on_arrays import NUMERIC
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.records import Record, piece

from .arm_response import ArmResponse
from .band import long_enough
from .motion import BRIDGED, BandedMotion, banded, in_long_runs
from .parity_equations import ARM, ARM_ENCODER, ENCODERS, JOINT, MOTOR, MOTOR_ENCODER, Rows, Signals
from .regression import STIFFNESS
from .terms import Hypothesis, follows_from_motion

FloatArray = NDArray[np.float64]

#: Factor by which the arm's response may differ from the model's, and a stiffness that is fixed.
_REACH, _FIXED = 4.0, 1.1
#: Damping of the arm's response where that is looked for, and where the search begins, as a share of its
#: undamped frequency.
_DAMPED, _BEGINS = (1e-3, 4.0), (0.02, 1.0)
#: Share of the input's torque that is none, and samples that an equation needs for each of its columns.
_NOTHING, _SAMPLES = 1e-6, 10
#: Mean direction of the motion within the filter's reach from which a dry friction slides, and share of the
#: rms velocity below which it may stick: then it is any torque up to its size.
_SLIDES, _STICKS = 0.97, 0.1
#: Added to the products of columns of length 1, so that those which are alike have a root.
_RIDGE = 1e-13
#: Correlation with the input from which what an actuator makes of it is a gain.
_GAIN = 0.999


def parity_residuals(
    model: Model,
    records: Sequence[Record],
    cutoff: float,
    known: Sequence[Effect] = (),
    encoders: bool = True,
    sliding: Sequence[Effect] = (),
) -> dict[str, float]:
    """What each place's parity equation leaves, rms, as a share of the input's torque: by place (motor, arm,
    joint, and with ``encoders`` arm_encoder and motor_encoder), of a flexible joint. What the motor's leaves
    is in units of the model's stiffness. The equation without the motor's encoder is one of signals as the
    arm follows them, which are smoother: it has the share of the best of the others, times what it leaves
    relative to that one as smooth. Beside a dry friction only samples count at which it slides, and an
    encoder may be left out. Empty where both encoders were read too seldom to say, or nothing drives.

    ``cutoff``: Hz, of the motion's band; ``known``: effects whose torques are allowed for, whatever their
    size, as far as `can_allow_for` says so; ``sliding``: frictions that are not, beside which only the same
    samples count: what is left beside them, too, is compared with that."""
    known = [effect for effect in known if can_allow_for(effect.entry)]
    stretches = [stretch for record in records for stretch in _both_read(record, cutoff)]
    every = (_signals(model, r, cutoff, known, sliding) for r in long_enough(stretches, cutoff))
    parts = [p for p in every if len(p.kept)]
    if not any(np.any(p.torque[p.kept]) for p in parts):
        return {}
    equations = {
        MOTOR: [p.without_motor(model.parameters["stiffness"]) for p in parts],
        ARM: [p.without_arm() for p in parts],
        JOINT: [p.without_joint() for p in parts],
    }
    if encoders:
        arms = _best(model, parts, Signals.without_arm_encoder)
        equations[ARM_ENCODER] = [p.without_arm_encoder(arm) for p, arm in zip(parts, arms, strict=True)]
    driven = _rms([p.torque[p.kept] for p in parts])
    found = {place: _left(_counted(parts, rows)) / driven for place, rows in equations.items()}
    if encoders:
        arms = _best(model, parts, Signals.without_motor_encoder)
        smooth = {
            place: _left(_counted(parts, [one.seen(arm) for one, arm in zip(rows, arms, strict=True)]))
            for place, rows in equations.items()
        }
        own = _left([p.without_motor_encoder(arm, p.kept) for p, arm in zip(parts, arms, strict=True)])
        best = {min(measure, key=lambda place: measure[place]) for measure in (found, smooth)}
        least = _NOTHING * driven
        found[MOTOR_ENCODER] = max(own / max(smooth[place], least) * found[place] for place in best)
        for encoder in _blurred(model, [*known, *sliding]):
            if found[encoder] > min(found.values()):
                del found[encoder]
    return found if all(map(math.isfinite, found.values())) else {}


def torque_at_the_motor(
    model: Model, records: Sequence[Record], cutoff: float, effect: Effect, place: str
) -> tuple[float, float, float] | None:
    """The size of an effect of one size at the motor that the equation of another place wants, whatever acts
    at that place; and what this equation leaves with and without it, rms, as a share of the input's torque.
    None where the encoders were read too seldom to say. ``place``: arm, joint or arm_encoder; the other
    arguments: see `parity_residuals`."""
    stretches = [stretch for record in records for stretch in _both_read(record, cutoff)]
    read = (_signals(model, r, cutoff, [effect, *model.effects]) for r in long_enough(stretches, cutoff))
    parts = [p for p in read if len(p.kept)]
    if place == ARM_ENCODER:
        arms = _best(model, parts, Signals.without_arm_encoder)
        equations = [p.without_arm_encoder(arm, p.kept) for p, arm in zip(parts, arms, strict=True)]
    else:
        every = [p.without_arm() if place == ARM else p.without_joint() for p in parts]
        equations = _counted(parts, every)
    if not equations or parts[0].known[MOTOR].shape[1] == 0:
        return None
    # A constant comes first, then what is known to act at the motor, with its sign on this side.
    bare = [replace(one, free=np.delete(one.free, 1, axis=1)) for one in equations]
    wider = [
        replace(
            one,
            structure=np.column_stack([one.structure, -full.free[:, 1]]),
            bounds=(*one.bounds, (-np.inf, np.inf)),
        )
        for one, full in zip(bare, equations, strict=True)
    ]
    (left, factors), (without, _) = _solved(wider), _solved(bare)
    driven = _rms([p.torque[p.kept] for p in parts])
    if not math.isfinite(left) or not math.isfinite(without):
        return None
    return float(factors[wider[0].structure.shape[1] - 1]), left / driven, without / driven


def _blurred(model: Model, known: Sequence[Effect]) -> tuple[str, ...]:
    """The encoders whose equation contains a dry friction as the arm follows it, and with that what it is off
    by while it sticks, at all samples: they say nothing unless they leave the least."""
    rubs = {acts_at(model, effect.location) for effect in known if _sticks(effect)}
    return ENCODERS if ARM in rubs else (MOTOR_ENCODER,) if MOTOR in rubs else ()


def _both_read(record: Record, cutoff: float) -> list[Record]:
    """The stretches of a record without a long hole of either encoder: a response does not go on over one."""
    missing = ~np.all(np.isfinite(record.measured), axis=1)
    holes = in_long_runs(missing, BRIDGED / (cutoff * record.dt))
    edges = np.flatnonzero(np.diff(np.concatenate([[1], holes.astype(np.int8), [1]])))
    return [piece(record, first, stop) for first, stop in edges.reshape(-1, 2).tolist()]


def _sticks(effect: Effect) -> bool:
    """Whether an effect is a friction that holds a joint at rest."""
    return effect.entry.memory == "direction"


def _signals(
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
    for place in {acts_at(model, effect.location) for effect in (*known, *sliding) if _sticks(effect)}:
        velocity = motion.velocity[:, int(place == ARM)]
        moves = np.clip(velocity / (_STICKS * _rms([velocity])), -1.0, 1.0)
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


def _best(
    model: Model, parts: Sequence[Signals], rows: Callable[[Signals, ArmResponse, NDArray[np.intp]], Rows]
) -> list[ArmResponse]:
    """The arm's response with which the equation without an encoder leaves least, at the samples of each
    recording."""
    p = model.parameters
    frequency = math.sqrt(p["stiffness"] / p["arm_inertia"])
    damped = float(np.clip(p["arm_damping"] / p["arm_inertia"] / frequency, *_BEGINS))
    given = np.log([frequency**2, damped * frequency])

    def arms(logarithms: FloatArray) -> list[ArmResponse]:
        stiffness, damping = np.exp(logarithms).tolist()
        return [ArmResponse(stiffness, damping, part.dt) for part in parts]

    def share(logarithms: FloatArray) -> float:
        equations = [rows(part, arm, part.kept) for part, arm in zip(parts, arms(logarithms), strict=True)]
        return _left(equations) / _rms([one.target for one in equations])

    reach = (frequency**2 / _REACH, frequency**2 * _REACH), tuple(share * frequency for share in _DAMPED)
    bounds = np.log(reach).tolist()
    return arms(scipy.optimize.minimize(share, given, method="Nelder-Mead", bounds=bounds, tol=1e-3).x)


def _counted(parts: Sequence[Signals], equations: Sequence[Rows]) -> list[Rows]:
    """The equations of all recordings at the samples that count."""
    return [one.at(part.kept) for part, one in zip(parts, equations, strict=True)]


def _left(equations: Sequence[Rows]) -> float:
    """Rms that the equations of all recordings leave (see `_solved`)."""
    return _solved(equations)[0]


def _solved(equations: Sequence[Rows]) -> tuple[float, FloatArray]:
    """Rms that the equations of all recordings leave with common parameters, by least squares, infinite with
    too few samples; and all parameters, the common ones first; what may have any sign is each recording's
    own."""
    common = equations[0].structure.shape[1]
    size = common + sum(one.free.shape[1] for one in equations)
    samples = sum(len(one.target) for one in equations)
    if samples < _SAMPLES * size:
        return math.inf, np.zeros(0)
    # Products of the columns and the target: the few numbers that least squares are of.
    products, mixed, whole, place = np.zeros((size, size)), np.zeros(size), 0.0, common
    for one in equations:
        own = np.r_[:common, place : (place := place + one.free.shape[1])]
        columns = np.column_stack([one.structure, one.free, one.target])
        among = columns.T @ columns
        products[np.ix_(own, own)] += among[:-1, :-1]
        mixed[own] += among[:-1, -1]
        whole += float(among[-1, -1])
    low, high = (np.full(size, side) for side in (-np.inf, np.inf))
    low[:common], high[:common] = np.transpose(equations[0].bounds)
    scale = np.sqrt(np.diag(products))
    shown = scale > 0.0
    scaled = products[np.ix_(shown, shown)] / np.outer(scale[shown], scale[shown])
    right = mixed[shown] / scale[shown]
    root = scipy.linalg.cholesky(scaled + _RIDGE * np.eye(len(scaled)))
    inside = scipy.linalg.solve_triangular(root, right, trans="T")
    bounds = (low * scale)[shown], (high * scale)[shown]
    found = scipy.optimize.lsq_linear(root, inside, bounds, method="bvls").x
    square = whole - 2.0 * float(found @ right) + float(found @ scaled @ found)
    factors = np.zeros(size)
    factors[shown] = found / scale[shown]
    return math.sqrt(max(square, 0.0) / (samples - len(found))), factors


def _rms(parts: Sequence[FloatArray]) -> float:
    return max(float(np.sqrt(np.mean(np.concatenate(parts) ** 2))), 1e-300)
