"""Contact of scenario 2: the Omni as slave against walls, by the thesis' law with an estimated torque.

    python tests/studies/contact_scenario2.py      # prints the table of docs/contact.md; half a minute

The Omni has no sensor that would show what it presses with, and its encoders are too coarse to see a stiff
wall give way. So each run is made twice: with the encoders as they are, for speed and bounces, and with ideal
ones, whose reading of the penetration gives the torque of the wall (Hunt and Crossley).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from haptic_teleop_control.parameters import load_parameter_file
from haptic_teleop_sim.lockstep import run_scenario
from haptic_teleop_sim.scenario_parameters import check_scenario

CONFIG = Path(__file__).resolve().parents[2] / "config" / "scenario2_sim.yaml"
WALLS = (5.0, 20.0, 100.0, 500.0, 2000.0)
TORQUES = (0.05, 0.1, 0.15)
LAMBDA, WALL, DISSIPATION, LEFT_WALL = 0.2, 0.4, 1.0, 3e-3
DEAD_ZONE, GAIN = 0.02, 0.2
ONSET, SECONDS = 0.5, 7.0
AXES = ("omni_y", "omni_z")


def simulate(wall: float, desired: float, resolution: float | None = None):
    """The Omni's states while the hands ask for `desired`, N·m, from ONSET on."""
    nodes = {name: dict(values) for name, values in load_parameter_file(CONFIG).items() if name != "scenario"}
    level = desired / GAIN + DEAD_ZONE
    for stage in ("stage1", "stage2"):
        nodes["signal_generator"] |= {
            f"{stage}.delay": ONSET, f"{stage}.steps.times": [0.0], f"{stage}.steps.levels": [level]
        }  # fmt: skip
    for axis in AXES:
        surface = {"angle": WALL, "stiffness": wall, "dissipation": DISSIPATION}
        nodes["omni_sim"] |= {f"{axis}.wall.{key}": value for key, value in surface.items()}
        if resolution is not None:
            nodes["omni_sim"][f"{axis}.resolution"] = resolution
    return run_scenario(check_scenario(nodes, CONFIG.parent, str(CONFIG)), SECONDS)["/omni/joint_states"]


def figures(axis: str, wall: float, desired: float) -> list[str]:
    """Cells of one row: speed error %, bounces, peak and settled torque of the wall, settling time."""
    coarse, ideal = simulate(wall, desired), simulate(wall, desired, 0.0)
    speed, angle, time = (
        coarse.signal(axis, "velocity"), coarse.signal(axis, "position"), coarse.time()
    )  # fmt: skip
    touched = np.flatnonzero(angle >= WALL)
    if not len(touched):
        return ["never reaches the wall"] + ["–"] * 4
    touch = int(touched[0])
    place = np.where(WALL - angle[touch:] > LEFT_WALL, -1, np.where(angle[touch:] >= WALL, 1, 0))
    place = place[place != 0]
    free = np.mean(speed[(time > time[touch] - 0.1) & (time < time[touch])])
    depth = np.maximum(ideal.signal(axis, "position") - WALL, 0.0)
    rate = np.gradient(depth, ideal.time())
    torque = np.maximum(wall * depth * (1.0 + DISSIPATION * rate), 0.0)
    after = torque[int(np.argmax(depth > 0.0)) :]
    outside = np.flatnonzero(np.abs(after - desired) > 0.05 * desired)
    last = int(outside[-1]) + 1 if len(outside) else 0
    settling = f"{last * 1e-3:.2f}" if last < len(after) - 500 else "never"
    return [
        f"{100.0 * (free / (desired / LAMBDA) - 1.0):+.1f}",
        str(int(np.sum((place[:-1] == 1) & (place[1:] == -1)))),
        f"{np.max(after):.3f}",
        f"{np.mean(after[-500:]):.3f}",
        settling,
    ]


def main() -> None:
    print("| axis | Td, N·m | wall, N·m/rad | free-speed error, % | bounces | peak of the wall's torque, N·m "
          "| settled, N·m | settling to ±5 %, s |")  # fmt: skip
    print("|" + "---|" * 8)
    for axis in AXES:
        for desired in TORQUES:
            for wall in WALLS:
                row = [axis, f"{desired:g}", f"{wall:g}", *figures(axis, wall, desired)]
                print("| " + " | ".join(row) + " |", flush=True)


if __name__ == "__main__":
    main()
