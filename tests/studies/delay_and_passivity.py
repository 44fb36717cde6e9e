"""How much delay the teleoperation bears: the tables in docs/teleoperation.md and docs/contact.md.

    python tests/studies/delay_and_passivity.py [scenario1] [scenario2] [filtered] [link] [blind]

Lockstep, deterministic. A hand (an impedance at the master) leads both stages to a surface, holds for 6 s
and lets go again. Stable: while it holds, less what drifts, the torque on the environment has a standard
deviation of at most 5 % of its mean, and the master's angle one of at most 2 mrad. The energies are the
lowest of either stage.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from haptic_teleop_sim.default_models import omni_axis_model
from haptic_teleop_sim.scenario_parameters import check_scenario
from haptic_teleop_sim.scenario_run import ScenarioResult, simulate_scenario

DELAYS = (0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3)
DURATION, HOLD = 11.0, (4.5, 7.5)
STABLE_TORQUE, STABLE_ANGLE = 0.05, 2e-3
EPSILON_LINK, EPSILON_MASTER = 2.5e-3, 10e-3
COMPENSATION = {
    "compensation.level.kp": 1.0, "compensation.level.ki": 4.0, "compensation.level.kd": 0.03,
    "compensation.spring": 0.1173, "compensation.ramp_time": 0.0,
}  # fmt: skip
# Name: stiffness N·m/rad, damping N·m·s/rad, inertia kg·m² of the hand.
GRIPS_OMNI = {"firm": (3.0, 0.05, 1e-3), "relaxed": (0.5, 0.01, 1e-3), "hardly held": (0.1, 0.003, 2e-4)}
GRIPS_SFJ = {"firm": (15.0, 0.3, 0.01), "relaxed": (4.0, 0.3, 0.01), "hardly held": (1.0, 0.3, 0.01)}


def hand(joint: str, grip: tuple[float, float, float], goal: float) -> dict[str, Any]:
    """Towards the surface, hold, away from it, back."""
    stiffness, damping, inertia = grip
    return {
        f"{joint}.hand.times": [0.3, 0.9, 7.5, 8.1, 8.7, 9.1],
        f"{joint}.hand.angles": [0.0, goal, goal, -0.5 * goal, -0.5 * goal, 0.0],
        f"{joint}.hand.stiffness": stiffness,
        f"{joint}.hand.damping": damping,
        f"{joint}.hand.inertia": inertia,
    }


def scenario1(grip: str, gain: float, link: dict[str, Any], damped: bool, **control: Any) -> dict[str, Any]:
    """The Omni leads; walls at 0.6 rad."""
    values = GRIPS_OMNI[grip]
    omni: dict[str, Any] = {**COMPENSATION, "operator.mode": "trajectory"}
    common: dict[str, Any] = {"command_source": "device", "link": True, "maximum_round_trip": 2.0}
    common |= {"passivity.controller": damped, "align.angle": 0.5, **control}
    for axis, angle in (("omni_y", 0.06), ("omni_z", 0.08)):
        omni |= hand(axis, values, angle * (1.0 + 0.3 / values[0]))
        common |= {f"{axis}.feedback_gain": gain, f"{axis}.torque_limit": 0.446}
    sfj = {
        f"stage{i}.wall.{key}": value for i in (1, 2) for key, value in (("angle", 0.6), ("dissipation", 1.0))
    }
    return {
        "sfj_sim": sfj,
        "omni_sim": omni,
        "force_controller": common,
        "signal_generator": {},
        "link": link,
    }


def scenario2(grip: str, gain: float, link: dict[str, Any], damped: bool, **control: Any) -> dict[str, Any]:
    """The 2DSFJ leads; surfaces at 0.4 rad."""
    values = GRIPS_SFJ[grip]
    omni: dict[str, Any] = {**COMPENSATION, "omni_y.wall.angle": 0.4, "omni_z.wall.angle": 0.4}
    sfj: dict[str, Any] = {"operator.mode": "trajectory"}
    common: dict[str, Any] = {"master": "sfj", "slave": "omni", "master_rate": 500.0, "slave_rate": 1000.0}
    common |= {"command_source": "device", "link": True, "maximum_round_trip": 2.0}
    common |= {"passivity.controller": damped, "align.angle": 0.5, **control}
    for stage in ("stage1", "stage2"):
        sfj |= hand(stage, values, 0.52 / 3.95 * (1.0 + 3.95 / values[0]))
        common |= {f"{stage}.master.feedback_gain": gain}
    return {
        "sfj_sim": sfj,
        "omni_sim": omni,
        "force_controller": common,
        "signal_generator": {},
        "link": link,
    }


def ripple(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Standard deviation of each column about its straight line while the hand holds."""
    span = (time > HOLD[0]) & (time < HOLD[1])
    t = time[span] - time[span].mean()
    left = values[span] - values[span].mean(axis=0)
    left = left - np.outer(t, t @ left / (t @ t))
    return left.std(axis=0)


def judge(result: ScenarioResult, master: str) -> tuple[bool, float, float, float]:
    """Whether it was stable, the worst ripple of the torque in %, the lowest energies of master and link."""
    omni, sfj = result.topics["/omni/joint_states"], result.topics["/sfj/joint_states"]
    touching, held = (
        (sfj.effort[:, [1, 3]], omni.position[:, 1:]),
        (omni.effort[:, 1:], sfj.position[:, [1, 3]]),
    )
    torque, angle = touching if master == "omni" else held
    times = (sfj.time(), omni.time()) if master == "omni" else (omni.time(), sfj.time())
    span = (times[0] > HOLD[0]) & (times[0] < HOLD[1])
    wobble = ripple(times[0], torque) / np.abs(torque[span].mean(axis=0))
    stable = bool(np.all(wobble <= STABLE_TORQUE) and np.all(ripple(times[1], angle) <= STABLE_ANGLE))
    energies = result.energies
    return stable, 100.0 * float(wobble.max()), energies["lowest master"].min(), energies["lowest link"].min()


def delays(make: Callable[..., dict[str, Any]], master: str, grips: dict, gains: tuple[float, ...]) -> None:
    """One row for each grip, gain and use of the passivity controller."""
    print(
        f"| grip | gain | controller | {' | '.join(f'{1e3 * d:g} ms' for d in DELAYS)} | stable, passive to |"
    )
    print("|" + "---|" * (len(DELAYS) + 4))
    for grip in grips:
        for gain in gains:
            for damped in (False, True):
                cells, limits, still = [], [0.0, 0.0], [True, True]
                for delay in DELAYS:
                    content = make(grip, gain, {"delay": delay}, damped)
                    result = simulate_scenario(check_scenario(content), DURATION)
                    stable, wobble, low_master, low_link = judge(result, master)
                    passive = low_link >= -EPSILON_LINK and low_master >= -EPSILON_MASTER
                    still = [still[0] and stable, still[1] and passive]
                    limits = [delay if s else limit for s, limit in zip(still, limits, strict=True)]
                    shown = f"{wobble:.1f} %" if wobble < 100.0 else "swings"
                    cells.append(f"{shown} {1e3 * low_master:.1f} {1e3 * low_link:.1f}")
                reached = [f"{1e3 * v:g} ms" if s or v else "–" for v, s in zip(limits, still, strict=True)]
                name = "on" if damped else "off"
                print(
                    f"| {grip} | {gain:g} | {name} | {' | '.join(cells)} | {', '.join(reached)} |", flush=True
                )


LINKS: dict[str, dict[str, Any]] = {
    "delay 20 ms": {"delay": 0.02},
    "jitter ±10 ms": {"delay": 0.02, "jitter": 0.01},
    "overtaken 5 %": {"delay": 0.02, "reorder": 0.05},
    "lost 1 %": {"delay": 0.02, "loss": 0.01},
    "lost 5 %": {"delay": 0.02, "loss": 0.05},
    "lost 20 %": {"delay": 0.02, "loss": 0.2},
    "lost 5 %, bursts of 5": {"delay": 0.02, "loss": 0.05, "burst": 5.0},
    "lost 5 %, bursts of 20": {"delay": 0.02, "loss": 0.05, "burst": 20.0},
    "all of it": {"delay": 0.02, "jitter": 0.01, "loss": 0.05, "reorder": 0.05, "duplicate": 0.05},
}


def links() -> None:
    """Scenario 1 with a firm hand and feedback 0.1 over bad links, ten seeds each: worst of them."""
    print("| link | ripple | lowest energy of the master, the link | seeds that ended in a fault |")
    print("|---|---|---|---|")
    for name, link in LINKS.items():
        found, faults = [], 0
        for seed in range(1, 11):
            content = scenario1("firm", 0.1, {**link, "seed": seed}, False)
            result = simulate_scenario(check_scenario(content), DURATION)
            if any(key.startswith("fault") for key in result.counts):
                faults += 1
                continue
            found.append(judge(result, "omni")[1:])
        worst = "– | –"
        if found:
            wobble, master, lost = np.array(found).T
            worst = f"{wobble.max():.1f} % | {1e3 * master.min():.1f}, {1e3 * lost.min():.1f} mJ"
        print(f"| {name} | {worst} | {faults} of 10 |", flush=True)


def sticking(axis: str, folder: Path) -> str:
    """The built-in model of `axis` with friction that sticks, as a file in `folder`; its name."""
    model = omni_axis_model(axis)
    model.with_values({f"{axis}_motor.stribeck_friction.smoothing": 0.0}).save(folder / f"{axis}.yaml")
    return f"{axis}.yaml"


def blind() -> None:
    """Scenario 2 in reference mode: what the Omni does with small desired torques, at soft surfaces, where
    its friction sticks; the observer believes in equation (22)."""
    print("| desired torque | asked | `standstill` 0: speed, pressed (Y; Z) | `standstill` 1: likewise |")
    print("|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        models = {f"{axis}.model": sticking(axis, folder) for axis in ("omni_y", "omni_z")}
        for desired in (0.01, 0.02, 0.03, 0.04, 0.06, 0.1, 0.15):
            cells = [_small(desired, standstill, models, folder) for standstill in (0.0, 1.0)]
            print(f"| {desired:g} N·m | {desired / 0.2:.2f} rad/s | {cells[0]} | {cells[1]} |", flush=True)


def _small(desired: float, standstill: float, models: dict[str, str], folder: Path) -> str:
    control: dict[str, Any] = {"master": "sfj", "slave": "omni", "master_rate": 500.0, "slave_rate": 1000.0}
    signal: dict[str, Any] = {"kind": "effort", "joints": ["stage1_arm", "stage2_arm"]}
    omni: dict[str, Any] = {**COMPENSATION, **models}
    for i, axis in ((1, "omni_y"), (2, "omni_z")):
        signal |= {f"stage{i}.enabled": True, f"stage{i}.delay": 0.5, f"stage{i}.step.enabled": True}
        signal |= {f"stage{i}.step.amplitude": desired / 0.2 + 0.02}
        control |= {f"{axis}.slave.observer.standstill": standstill}
        # So soft that its depth, read in steps of the encoder, tells the torque to 1 mN·m.
        omni |= {f"{axis}.wall.angle": 0.4, f"{axis}.wall.stiffness": 2.0}
    content = {"sfj_sim": {}, "omni_sim": omni, "force_controller": control, "signal_generator": signal}
    states = simulate_scenario(check_scenario(content, folder), 14.0).topics["/omni/joint_states"]
    time, found = states.time(), []
    for column in (1, 2):
        position = states.position[:, column]
        free = (time > 0.9) & (np.maximum.accumulate(position) < 0.39)
        pressed = 2.0 * (position[time > 13.0].mean() - 0.4)
        speed = states.velocity[free, column][-200:].mean()
        found.append(f"{speed:.2f} rad/s, " + (f"{pressed:.3f} N·m" if pressed > 0.0 else "no contact"))
    return "; ".join(found)


def main(argv: list[str]) -> None:
    wanted = argv or ["scenario1", "scenario2", "filtered", "link", "blind"]
    if "scenario1" in wanted:
        print("\nScenario 1. Per delay, one way: ripple, lowest energy of master and link in mJ.\n")
        delays(scenario1, "omni", GRIPS_OMNI, (0.1, 0.2))
    if "scenario2" in wanted:
        print("\nScenario 2, likewise.\n")
        delays(scenario2, "sfj", GRIPS_SFJ, (1.0, 2.0))
    if "filtered" in wanted:
        print("\nScenario 2 with the low-pass of the shipped files, likewise.\n")
        low_pass = {f"stage{i}.master.feedback_cutoff_hz": 10.0 for i in (1, 2)}
        delays(partial(scenario2, **low_pass), "sfj", GRIPS_SFJ, (1.0,))
    if "link" in wanted:
        print("\nScenario 1, firm hand, feedback 0.1, over bad links.\n")
        links()
    if "blind" in wanted:
        print("\nScenario 2: small torques.\n")
        blind()


if __name__ == "__main__":
    main(sys.argv[1:])
