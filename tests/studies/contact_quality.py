"""Contact and free motion of the force laws, side by side, over walls, speeds, plants and friction.

    python tests/studies/contact_quality.py                 # prints the tables; some minutes
    python tests/studies/contact_quality.py --write docs    # draws the picture of docs/contact.md

Each run: an arm 2.2 rad away from a wall is commanded towards it with a constant Td and pressed against it,
500 samples a second, encoders, amplifier and velocity filter as in the robot, nothing random but the current
sense's noise, whose seed is fixed. Both laws meet the very same plants.
"""

from __future__ import annotations

import argparse
import itertools
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import Progress

from haptic_teleop_control.laws import ForceLaw, find_law
from haptic_teleop_control.robots import SFJ_STAGES, STAGES
from haptic_teleop_sim.default_models import sfj_stage_model
from haptic_teleop_sim.hardware import SfjRobot
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sim.sfj_robot import SfjSettings, Surroundings, stage_hardware

DT = 0.002
LAMBDA = 0.5
WALLS = (5.0, 20.0, 100.0, 500.0, 2000.0)
SPEEDS = (0.4, 1.0, 1.6)
START, WALL = -1.4, 0.8
CONTACT_SECONDS = 4.0
LEFT_WALL = 3e-3
"""rad; an arm that is this far from the wall's surface has left it: twelve counts of its encoder."""
FACTORS = ("motor_inertia", "motor_damping", "arm_inertia", "arm_damping", "stiffness", "torque_constant")
"""What is changed by ±30 %; the drive's Coulomb friction goes with its damping."""


@dataclass(frozen=True)
class Plant:
    """Factors on the nominal parameters, in the order of FACTORS; friction: Coulomb friction of the drive."""

    name: str
    factors: tuple[float, ...] = (1.0,) * len(FACTORS)
    friction: bool = True

    def model(self, stage: str, wall: float, dissipation: float = 1.0, delay: float = 0.0) -> Model:
        """The stage's model with the wall, N·m/rad; delay: s, of the current behind its command."""
        model = sfj_stage_model(stage)
        scale = dict(zip(FACTORS, self.factors, strict=True))
        parameters = {name: value * scale.get(name, 1.0) for name, value in model.parameters.items()}
        effects = []
        for effect in model.effects:
            if effect.effect == "coulomb_friction":
                torque = effect.parameters["torque"] * scale["motor_damping"] * self.friction
                effect = replace(effect, parameters={"torque": torque})
            effects.append(effect)
        if delay:
            effects.append(Effect("input_delay", f"{stage}_actuator", {"delay": delay}))
        model = replace(model, parameters=parameters, effects=tuple(effects))
        return Surroundings(wall_angle=WALL, wall_stiffness=wall, wall_dissipation=dissipation).apply(model)

    def top_speed(self, stage: str) -> float:
        """rad/s that the drive reaches in free motion at its current limit."""
        model = self.model(stage, 1000.0)
        friction = sum(e.parameters["torque"] for e in model.effects if e.effect == "coulomb_friction")
        p = model.parameters
        driving = p["torque_constant"] * SFJ_STAGES[stage].current_limit - friction
        return driving / (p["motor_damping"] + p["arm_damping"])


def plants() -> list[Plant]:
    """The nominal plant and eight corners of ±30 % (a fractional factorial of six factors: each factor high
    in four of the corners, any two of them independent), all with and without Coulomb friction."""
    found = [Plant("nominal")]
    for number, (a, b, c) in enumerate(itertools.product((-1, 1), repeat=3), start=1):
        signs = (a, b, c, a * b, a * c, b * c)
        found.append(Plant(f"corner {number}", tuple(1.0 + 0.3 * sign for sign in signs)))
    return found + [replace(one, name=f"{one.name}, no friction", friction=False) for one in found]


@dataclass(frozen=True)
class Case:
    """One run of both stages. speed: Td/lambda, rad/s."""

    plant: Plant
    wall: float
    speed: float
    dissipation: float = 1.0
    delay: float = 0.0


@dataclass(frozen=True)
class Merit:
    """What came of one stage in one run.

    speed_error: %, mean of the last 0.1 s before the wall against Td/lambda. free_rms: %, rms of th1' -
    Td/lambda over all free motion from the command on, of Td/lambda. overshoot: %, of the greatest Te after
    the touch above Td. bounces: how often the arm left the wall. impulse: N·m·s, of the wall on the arm in
    the first 0.1 s. settling: s from the touch until Te stays within 5 % of Td, NaN: not within the run.
    contact_rms: mN·m, rms of Td - Te in the second after settling is due (1.5 to 2.5 s after the touch).
    weak: the drive cannot reach Td/lambda at its current limit.
    """

    stage: str
    case: Case
    speed_error: float
    free_rms: float
    overshoot: float
    bounces: int
    impulse: float
    settling: float
    contact_rms: float
    weak: bool

    @property
    def meets_aim(self) -> bool:
        """Overshoot and free speed as wanted, no second bounce, settled."""
        fast = self.weak or abs(self.speed_error) <= 2.0
        return self.overshoot <= 5.0 and self.bounces <= 1 and fast and not math.isnan(self.settling)


def simulate(case: Case, law: ForceLaw) -> tuple[np.ndarray, np.ndarray]:
    """Time (n,) s and what the robot shows (n, 3, 4), as in /sfj/joint_states."""
    hardware = [
        stage_hardware(
            stage, case.plant.model(stage, case.wall, case.dissipation, case.delay), initial_angle=START
        )
        for stage in STAGES
    ]
    robot = SfjRobot(SfjSettings(*hardware), DT)
    n = round(((WALL - START) / case.speed + 0.6 + CONTACT_SECONDS) / DT)
    shown = np.empty((n, 3, 4))
    desired = np.full(2, LAMBDA * case.speed)
    for k in range(n):
        for row, signal in enumerate(robot.sense()):
            shown[k, row] = signal
        position, velocity = shown[k, 0], shown[k, 1]
        current = law.step(desired, position[0::2], position[1::2], velocity[0::2])
        robot.step(current * law.torque_constant)
    return np.arange(n) * DT, shown


def merit(case: Case, stage: str, time_: np.ndarray, shown: np.ndarray) -> Merit:
    """The figures of one stage of a run."""
    i = STAGES.index(stage)
    desired, speed = LAMBDA * case.speed, shown[:, 1, 2 * i]
    arm, arm_speed, torque = shown[:, 0, 2 * i + 1], shown[:, 1, 2 * i + 1], shown[:, 2, 2 * i + 1]
    touched = np.flatnonzero(arm >= WALL)
    touch = int(touched[0]) if len(touched) else len(arm) - 1
    after = torque[touch:]
    outside = np.flatnonzero(np.abs(after - desired) > 0.05 * desired)
    last = int(outside[-1]) + 1 if len(outside) else 0
    place = np.where(WALL - arm[touch:] > LEFT_WALL, -1, np.where(arm[touch:] >= WALL, 1, 0))
    place = place[place != 0]
    p = case.plant.model(stage, case.wall).parameters
    first, tenth = slice(touch, touch + 50), min(touch + 50, len(arm) - 1)
    # Balance of the arm's momentum; its velocity before the touch is that of a moment earlier.
    lost = arm_speed[max(touch - 5, 0)] - arm_speed[tenth]
    drag = p["arm_damping"] * (arm[tenth] - arm[touch])
    true_torque = torque * p["stiffness"] / SFJ_STAGES[stage].stiffness
    steady = torque[touch + 750 : touch + 1250]
    return Merit(
        stage=stage,
        case=case,
        speed_error=100.0 * (float(np.mean(speed[max(touch - 50, 0) : touch])) / case.speed - 1.0),
        free_rms=100.0 * float(np.sqrt(np.mean((speed[:touch] - case.speed) ** 2))) / case.speed,
        overshoot=100.0 * (float(np.max(after)) / desired - 1.0),
        bounces=int(np.sum((place[:-1] == 1) & (place[1:] == -1))),
        impulse=float(np.sum(true_torque[first]) * DT + p["arm_inertia"] * lost - drag),
        settling=last * DT if last < len(after) - 250 else math.nan,
        contact_rms=1e3 * float(np.sqrt(np.mean((steady - desired) ** 2))) if len(steady) else math.nan,
        weak=case.plant.top_speed(stage) < case.speed,
    )


def run(cases: list[Case], law: str) -> Iterator[list[Merit]]:
    """The merits of both stages, case by case."""
    made = find_law(law).from_parameters({}, STAGES, DT)
    for case in cases:
        made.reset()
        time_, shown = simulate(case, made)
        yield [merit(case, stage, time_, shown) for stage in STAGES]


def evaluate(cases: list[Case], laws: list[str]) -> dict[str, list[Merit]]:
    """law -> merits of all cases, with progress on standard error."""
    found: dict[str, list[Merit]] = {law: [] for law in laws}
    with Progress(console=Console(stderr=True), transient=True) as progress:
        for law in laws:
            for pair in progress.track(run(cases, law), len(cases), description=law):
                found[law] += pair
    return found


def grid() -> list[Case]:
    """Every plant at every wall and speed."""
    return [Case(*one) for one in itertools.product(plants(), WALLS, SPEEDS)]


def beside_the_grid() -> dict[str, list[Case]]:
    """What the grid does not vary: name -> cases with the nominal plant."""
    nominal = Plant("nominal")
    pairs = list(itertools.product((100.0, 2000.0), SPEEDS))
    return {
        "wall without dissipation": [Case(nominal, w, v, dissipation=0.0) for w, v in pairs],
        "wall with five times the dissipation": [Case(nominal, w, v, dissipation=5.0) for w, v in pairs],
        "current 2 ms late": [Case(nominal, w, v, delay=0.002) for w, v in pairs],
        "current 4 ms late": [Case(nominal, w, v, delay=0.004) for w, v in pairs],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--write", metavar="DIR", help="put the picture into DIR/contact.png")
    parser.add_argument("--law", nargs="+", default=["augmented_error", "disturbance_observer"])
    options = parser.parse_args()
    from contact_report import picture, tables  # the report lies beside this script

    begun = time.perf_counter()
    results = evaluate(grid(), options.law)
    others = {name: evaluate(cases, options.law) for name, cases in beside_the_grid().items()}
    text = tables(results, others)
    print(text)
    print(f"{time.perf_counter() - begun:.0f} s")
    if options.write:
        path = Path(options.write) / "contact.png"
        picture(options.law).savefig(path, dpi=100, facecolor="white")


if __name__ == "__main__":
    main()
