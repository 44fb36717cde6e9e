"""Contact of scenario 2: the Omni as slave against walls, by the thesis' law with an estimated torque.

    python tests/studies/contact_scenario2.py      # prints the tables of docs/contact.md; some ten minutes

Walls, desired torques, the nominal device and eight corners of ±30 %, all with and without Coulomb friction;
the law knows the nominal device only. The Omni has no sensor that would show what it presses with, and its
encoders are too coarse to see a stiff wall give way. So each run is made twice: with the encoders as they
are, for speed and bounces, and with ideal ones, whose reading of the penetration gives the torque of the wall
(Hunt and Crossley).
"""

from __future__ import annotations

import itertools
import math
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from haptic_teleop_control.parameter_files import load_parameter_file
from haptic_teleop_sim.default_models import omni_axis_model
from haptic_teleop_sim.lockstep import run_scenario
from haptic_teleop_sim.scenario_parameters import check_scenario

CONFIG = Path(__file__).resolve().parents[2] / "config" / "scenario2_sim.yaml"
WALLS = (5.0, 20.0, 100.0, 500.0, 2000.0)
TORQUES = (0.05, 0.1, 0.15)
LAMBDA, WALL, DISSIPATION, LEFT_WALL = 0.2, 0.4, 1.0, 3e-3
DEAD_ZONE, GAIN = 0.02, 0.2
ONSET, SECONDS = 0.5, 7.0
AXES = ("omni_y", "omni_z")
FRICTION = ("coulomb", "breakaway")
COLUMNS = (
    "free-speed error, %", "free rms, %", "overshoot, %", "bounces", "impulse, N·m·s", "settling, s",
    "rms Td − Te, mN·m", "aim met",
)  # fmt: skip


@dataclass(frozen=True)
class Device:
    """Factors on the nominal device, of both axes alike. friction: Coulomb and breakaway."""

    name: str
    inertia: float = 1.0
    damping: float = 1.0
    friction: float = 1.0
    spring: float = 1.0
    torque_constant: float = 1.0

    def write(self, folder: Path) -> dict[str, str]:
        """The models of both axes as files in `folder`: parameters of omni_sim that name them."""
        for axis in AXES:
            model, values = omni_axis_model(axis), {}
            scale = {"motor_inertia": self.inertia, "torque_constant": self.torque_constant}
            scale["motor_damping"] = self.damping
            parameters = {key: value * scale.get(key, 1.0) for key, value in model.parameters.items()}
            for effect in model.effects:
                factor = {"stribeck_friction": self.friction, "spring_to_ground": self.spring}
                names = {"stribeck_friction": FRICTION, "spring_to_ground": ("stiffness",)}
                for name in names.get(effect.effect, ()):
                    key = f"{axis}_motor.{effect.effect}.{name}"
                    values[key] = effect.parameters[name] * factor[effect.effect]
            replace(model, parameters=parameters).with_values(values).save(folder / f"{axis}.yaml")
        return {f"{axis}.model": f"{axis}.yaml" for axis in AXES}


def devices() -> list[Device]:
    """The nominal device and eight corners of ±30 % (a fractional factorial of five factors), all with and
    without Coulomb friction."""
    found = [Device("nominal")]
    for number, (a, b, c) in enumerate(itertools.product((-1, 1), repeat=3), start=1):
        factors = (1.0 + 0.3 * sign for sign in (a, b, c, a * b, a * c))
        found.append(Device(f"corner {number}", *factors))
    return found + [replace(one, name=f"{one.name}, no friction", friction=0.0) for one in found]


@dataclass(frozen=True)
class Merit:
    """What came of one axis in one run. peak, settled: N·m, of the wall. The others as in COLUMNS; settling
    NaN: not within the run."""

    speed_error: float
    free_rms: float
    overshoot: float
    bounces: int
    impulse: float
    settling: float
    contact_rms: float
    peak: float
    settled: float

    @property
    def meets_aim(self) -> bool:
        free = abs(self.speed_error) <= 2.0
        return free and self.overshoot <= 5.0 and self.bounces <= 1 and not math.isnan(self.settling)


def simulate(wall: float, desired: float, device: Device, folder: Path, ideal: bool):
    """The Omni's states while the hands ask for `desired`, N·m, from ONSET on."""
    nodes = {name: dict(values) for name, values in load_parameter_file(CONFIG).items() if name != "scenario"}
    level = desired / GAIN + DEAD_ZONE
    for stage in ("stage1", "stage2"):
        nodes["signal_generator"] |= {
            f"{stage}.delay": ONSET, f"{stage}.steps.times": [0.0], f"{stage}.steps.levels": [level]
        }  # fmt: skip
    nodes["omni_sim"] |= device.write(folder)
    for axis in AXES:
        surface = {"angle": WALL, "stiffness": wall, "dissipation": DISSIPATION}
        nodes["omni_sim"] |= {f"{axis}.wall.{key}": value for key, value in surface.items()}
        if ideal:
            nodes["omni_sim"][f"{axis}.resolution"] = 0.0
    return run_scenario(check_scenario(nodes, folder, str(CONFIG)), SECONDS)["/omni/joint_states"]


def merits(wall: float, desired: float, device: Device) -> dict[str, Merit | None]:
    """axis -> what came of it; None where it never reached the wall."""
    with tempfile.TemporaryDirectory() as name:
        coarse, ideal = (simulate(wall, desired, device, Path(name), exact) for exact in (False, True))
    return {axis: _merit(coarse, ideal, axis, wall, desired) for axis in AXES}


def _merit(coarse, ideal, axis: str, wall: float, desired: float) -> Merit | None:
    speed, angle, time = (
        coarse.signal(axis, "velocity"), coarse.signal(axis, "position"), coarse.time()
    )  # fmt: skip
    depth = np.maximum(ideal.signal(axis, "position") - WALL, 0.0)
    touched = np.flatnonzero(angle >= WALL)
    if not len(touched) or not np.any(depth > 0.0):
        return None
    touch = int(touched[0])
    place = np.where(WALL - angle[touch:] > LEFT_WALL, -1, np.where(angle[touch:] >= WALL, 1, 0))
    place = place[place != 0]
    asked = desired / LAMBDA
    free = speed[(time > time[touch] - 0.1) & (time < time[touch])]
    on_the_way = speed[(time >= ONSET) & (time < time[touch])]
    torque = np.maximum(wall * depth * (1.0 + DISSIPATION * np.gradient(depth, ideal.time())), 0.0)
    after = torque[int(np.argmax(depth > 0.0)) :]
    outside = np.flatnonzero(np.abs(after - desired) > 0.05 * desired)
    last = int(outside[-1]) + 1 if len(outside) else 0
    steady = after[1500:2500]
    return Merit(
        speed_error=100.0 * (float(np.mean(free)) / asked - 1.0),
        free_rms=100.0 * float(np.sqrt(np.mean((on_the_way - asked) ** 2))) / asked,
        overshoot=100.0 * (float(np.max(after)) / desired - 1.0),
        bounces=int(np.sum((place[:-1] == 1) & (place[1:] == -1))),
        impulse=float(np.sum(after[:100])) * 1e-3,
        settling=last * 1e-3 if last < len(after) - 500 else math.nan,
        contact_rms=1e3 * float(np.sqrt(np.mean((steady - desired) ** 2))) if len(steady) else math.nan,
        peak=float(np.max(after)),
        settled=float(np.mean(after[-500:])),
    )


def main() -> None:
    from contact_scenario2_report import report  # it lies beside this script

    found = {
        (device.name, desired, wall, axis): merit
        for device in devices()
        for desired in TORQUES
        for wall in WALLS
        for axis, merit in merits(wall, desired, device).items()
    }
    print(report(found))


if __name__ == "__main__":
    main()
