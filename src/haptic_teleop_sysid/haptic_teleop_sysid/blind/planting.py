"""Runs the concealed robot with and without effects, and sizes an effect to a wanted detectability."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from haptic_teleop_sysid.blind.detect import COLUMNS, Column, Driven, Whitener, detectability
from haptic_teleop_sysid.blind.effects import Kind, Parameters, Scene
from haptic_teleop_sysid.blind.outside import gate_of
from haptic_teleop_sysid.blind.physics import integrate
from haptic_teleop_sysid.blind.robot import LOOPS, PERIOD, Experiment, Robot
from haptic_teleop_sysid.blind.slots import INDEX, empty

Array = NDArray[np.float64]
STEPS, QUIET_STEPS = 100, 50
"""Integration steps per sample: 20 µs for recordings, 40 µs where only the size of an effect is sought."""
ATTEMPTS = 7


@dataclass(frozen=True)
class Planted:
    """One effect with its numbers, at `part` of the stage; `sees`: the current sense is behind it."""

    kind: Kind
    part: str
    parameters: Parameters
    sees: bool = False
    detectability: float = math.nan

    def location(self, stage: str) -> str:
        """Location in the words of diagnosis.json."""
        return f"{stage}_{self.part}"


@dataclass(frozen=True)
class Setting:
    """One recording's conditions: the stage, how it is driven, and what the other stage does meanwhile."""

    robot: Robot
    experiment: Experiment
    other_speed: Array
    other_acceleration: Array

    @property
    def samples(self) -> int:
        """Number of samples."""
        return len(self.experiment.reference)


@dataclass(frozen=True)
class Run:
    """`out` (n, signals) of the integrator, and the recorded values before noise of the sense."""

    out: Array
    sensed: Array
    motor_read: Array
    arm_read: Array
    motor_shown: Array
    arm_shown: Array

    @property
    def settled(self) -> bool:
        """False when the stage ran away."""
        return bool(np.isfinite(self.out).all() and np.max(np.abs(self.out[:, :2])) < 2.2)


def run(
    setting: Setting,
    planted: list[Planted],
    scene: Scene | None,
    push: Array | None = None,
    path: Array | None = None,
    follow: bool = False,
) -> Run:
    """Return what happens; without `push` there is neither random torque nor quantisation.

    `path`: filled with where the robot was, or, with `follow`, where it is led along (see `integrate`).
    """
    robot, experiment, n = setting.robot, setting.experiment, setting.samples
    slots = empty()
    gate = np.zeros((n, 3))
    gate[:, 0] = 1.0
    for one in planted:
        assert scene is not None
        for name, value in one.kind.place(one.parameters, one.part, scene).items():
            slots[INDEX[name]] = value
        if one.sees:
            slots[INDEX["sense_sees"]] = 1.0
        gate_of(one.kind.effect, one.part, one.parameters, gate, PERIOD)
    quiet = push is None
    out = integrate(
        robot.vector(),
        slots,
        LOOPS[experiment.loop],
        experiment.gains,
        experiment.reference,
        np.zeros((n + 1, 2)) if push is None else push,
        gate,
        setting.other_speed,
        setting.other_acceleration,
        QUIET_STEPS if quiet else STEPS,
        not quiet,
        np.zeros((0, 6)) if path is None else path,
        follow,
    )
    shown = {"motor": out[:, 6], "arm": out[:, 7]}
    read = {"motor": out[:, 4], "arm": out[:, 5]}
    sensed = out[:, 9]
    for one in planted:
        if one.kind.effect == "channel_skew":
            delay = one.parameters["delay"]
            if one.part == "actuator":
                sensed = _shifted(sensed, delay)
            else:
                side = one.part.removesuffix("_encoder")
                at = 0 if side == "motor" else 1
                shown[side] = _read_at(shown[side], out[:, at], out[:, 2 + at], delay)
                step = robot.vector()[7 if side == "motor" else 8]
                read[side] = shown[side] if quiet else step * np.floor(shown[side] / step + 0.5)
    return Run(out, sensed, read["motor"], read["arm"], shown["motor"], shown["arm"])


def _shifted(values: Array, delay: float) -> Array:
    """Values that change evenly from sample to sample, or means of what is held, `delay` later (s)."""
    time = np.arange(len(values)) * PERIOD
    return np.interp(time - delay, time, values)


def _read_at(shown: Array, angle: Array, velocity: Array, delay: float) -> Array:
    """What an encoder shows `delay` later (s), rad: between samples the axis moves as its angles and
    velocities say, not along a chord, from which a lively command bends it by more than an encoder's step."""
    time = np.arange(len(shown)) * PERIOD
    moved = CubicHermiteSpline(time, angle, velocity)(np.clip(time - delay, time[0], time[-1]))
    return np.asarray(moved + _shifted(shown - angle, delay), dtype=np.float64)


def shares_of(
    setting: Setting, planted: list[Planted], scenes: dict[str, Scene], push: Array
) -> tuple[Run, list[Column]]:
    """Return the run with all of `planted`, and what each of them adds to the others on its way.

    Not what each would add alone: a spring that holds the motor leaves its friction no way to show.
    """
    path = np.zeros((setting.samples * STEPS + 1, 6))
    together = run(setting, planted, scenes[planted[0].part], push, path)
    commanded = replace(
        setting,
        experiment=replace(setting.experiment, loop="open loop current", reference=together.out[:, 8].copy()),
    )
    total = contribution(setting, together)
    shares = []
    for one in planted:
        others = [other for other in planted if other is not one]
        without = contribution(
            setting, run(commanded, others, scenes[planted[0].part], push, path, follow=True)
        )
        shares.append(Column(*(getattr(total, n) - getattr(without, n) for n in COLUMNS)))
    return together, shares


def driven_of(setting: Setting, quiet: Run) -> Driven:
    """Return the trajectory as columns see it."""
    out = quiet.out

    def mean_rate(values: Array) -> Array:
        rate = np.diff(values) / PERIOD
        return np.append(rate, rate[-1])

    return Driven(
        motor=out[:, 0],
        arm=out[:, 1],
        motor_speed=mean_rate(out[:, 0]),
        arm_speed=mean_rate(out[:, 1]),
        motor_acceleration=mean_rate(out[:, 2]),
        arm_acceleration=mean_rate(out[:, 3]),
        current=out[:, 8],
        other_acceleration=setting.other_acceleration,
        time=np.arange(len(out), dtype=np.float64) * PERIOD,
    )


def contribution(setting: Setting, quiet: Run) -> Column:
    """Return what the planted physics adds to the linear model driven by the commanded current.

    Where the sense sees the effect, the difference of command and sense is evidence beside the motion.
    """
    out = quiet.out
    kt = setting.robot.truth["torque_constant"]
    return Column(
        motor_force=out[:, 10] + kt * (out[:, 9] - out[:, 8]),
        arm_force=out[:, 11],
        motor_error=quiet.motor_shown - out[:, 0],
        arm_error=quiet.arm_shown - out[:, 1],
        current=quiet.sensed - out[:, 8],
    )


def scene_of(setting: Setting, quiet: Run, part: str) -> Scene:
    """Return the scale of everything at `part`, from the experiment without effects."""
    out, truth = quiet.out, setting.robot.truth
    column = 1 if part.startswith("arm") else 0
    acceleration = np.diff(out[:, 3]) / PERIOD
    return Scene(
        torque_constant=truth["torque_constant"],
        stiffness=truth["stiffness"],
        arm_inertia=truth["arm_inertia"],
        arm_damping=truth["arm_damping"],
        torque=truth["torque_constant"] * float(np.std(out[:, 8]))
        if column == 0
        else truth["arm_inertia"] * float(np.std(acceleration)),
        current=float(np.max(np.abs(out[:, 8]))),
        speed=float(np.std(out[:, 2 + column])),
        low=float(out[:, column].min()),
        high=float(out[:, column].max()),
        deflection=float(np.std(out[:, 0] - out[:, 1])),
        load=truth["arm_inertia"] * float(np.std(acceleration)),
        duration=setting.samples * PERIOD,
    )


def fitted_to(
    level: float,
    kind: Kind,
    part: str,
    parameters: Parameters,
    sees: bool,
    setting: Setting,
    scene: Scene,
    filter_: Whitener,
    known_torque_constant: bool,
) -> Planted | None:
    """Return the effect at the size at which d' is `level` within 10 %, or the nearest reached.

    None when with every size tried the robot runs away or stands still (a dead zone wider than the command).
    d' grows like a power of the size: a secant in logarithms.
    """
    size, best, history = 1.0, None, []
    for _ in range(ATTEMPTS):
        sized = Planted(kind, part, kind.sized(parameters, size, scene), sees)
        quiet = run(setting, [sized], scene)
        if not quiet.settled or np.ptp(quiet.out[:, 0]) == 0.0:
            size *= 0.3
            continue
        found = detectability(
            filter_, driven_of(setting, quiet), contribution(setting, quiet), known_torque_constant
        )
        found = max(found, 1e-9)
        miss = math.log(level / found)
        if best is None or abs(miss) < abs(math.log(level / best.detectability)):
            best = Planted(kind, part, sized.parameters, sees, found)
        if abs(miss) < 0.1:
            break
        power = 1.0
        if history and history[-1][0] != size:
            slope = (math.log(found) - math.log(history[-1][1])) / (math.log(size) - math.log(history[-1][0]))
            power = min(max(slope, 0.4), 3.0)
        history.append((size, found))
        following = min(size * math.exp(min(max(miss / power, -4.0), 3.0)), kind.most)
        if following == size:
            break
        size = following
    return best
