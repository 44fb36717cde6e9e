"""How fast plants are: simulated, differentiated, and as a whole scenario; against a general solver and the
clock.

All figures of one run are taken one after another on the same processor, and each is the best of several
repetitions, because what else the machine does can only make them longer.
"""

import sys
import time
from pathlib import Path

import numpy as np
from _promises import Promises
from scipy.integrate import solve_ivp

from haptic_teleop_sim.kernel import pack, predict, simulate
from haptic_teleop_sim.lockstep import load_scenario
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sim.scenario_run import simulate_scenario

SCENARIO = Path(__file__).resolve().parents[2] / "config" / "scenario1_sim.yaml"
DT, N = 1e-3, 60_000
PARAMETERS = {
    "torque_constant": 8.925,
    "stiffness": 3.971,
    "motor_inertia": 0.0635,
    "motor_damping": 2.6,
    "arm_inertia": 0.17,
    "arm_damping": 0.02,
}
#: The sign of the velocity smoothed as in equation (22), because a general solver needs a smooth right-hand
#: side.
COULOMB = {"torque": 0.3, "smoothing": 0.02}
GRADIENT_PARAMETERS = 9


def best(function, repetitions):
    """Least time of several calls, s, and the last result."""
    times = []
    for _ in range(repetitions):
        start = time.perf_counter()
        result = function()
        times.append(time.perf_counter() - start)
    return min(times), result


def joint(*effects):
    return Model("sfj", "stage1", "flexible_joint", PARAMETERS).with_effects(*effects)


def solved(current):
    """The same joint by a general solver with the usual settings, the input held over each sample."""
    m = PARAMETERS

    def rates(t, x):
        torque = m["torque_constant"] * current[min(int(t / DT), N - 1)]
        coupling = m["stiffness"] * (x[0] - x[1])
        friction = COULOMB["torque"] * np.tanh(x[2] / COULOMB["smoothing"])
        motor = (torque - m["motor_damping"] * x[2] - friction - coupling) / m["motor_inertia"]
        return [x[2], x[3], motor, (coupling - m["arm_damping"] * x[3]) / m["arm_inertia"]]

    t = DT * np.arange(N)
    return solve_ivp(rates, (0.0, t[-1]), np.zeros(4), t_eval=t, rtol=1e-6, atol=1e-9, max_step=5 * DT).y.T


def main() -> int:
    promise = Promises()
    t = DT * np.arange(N)
    current = 0.2 * np.sin(2 * np.pi * 0.5 * t) + 0.05 * np.sin(2 * np.pi * 3.1 * t)
    friction = joint(Effect("coulomb_friction", "stage1_motor", COULOMB))

    start = time.perf_counter()
    simulate(friction, current[:10], DT)
    print(f"first simulation, compiled code loaded from disk or made: {time.perf_counter() - start:.2f} s")
    ours, run = best(lambda: simulate(friction, current, DT), 20)
    theirs, reference = best(lambda: solved(current), 1)
    error = np.abs(run.states[:, :4] - reference).max(axis=0) / np.ptp(reference, axis=0)
    print(
        f"60 s at 1 kHz of a flexible joint with friction: {1e3 * ours:.1f} ms; "
        f"solve_ivp at 1e-6: {theirs:.1f} s"
    )
    print(f"   ratio {theirs / ours:.0f}; largest difference {1e2 * error.max():.3f} % of the range")
    promise(theirs > 300.0 * ours, "at least 300 times as fast as the general solver")
    promise(error.max() < 0.01, "the same solution within 1 %")

    stick, _ = best(
        lambda: simulate(joint(Effect("coulomb_friction", "stage1_motor", {"torque": 0.3})), current, DT), 10
    )
    print(f"the same with friction that sticks: {1e3 * stick:.1f} ms")

    nine = friction.with_effects(Effect("hardening_spring", "stage1_joint", {"cubic": 10.0}))
    free = nine.free_parameters()
    assert len(free) == GRADIENT_PARAMETERS, free
    packed, measured = pack(nine), np.column_stack([run.motor_position, run.arm_position])
    gradient, _ = best(lambda: predict(packed, current, measured, DT, free), 10)
    plain, _ = best(lambda: predict(packed, current, measured, DT), 10)
    print(
        f"its exact derivatives by {len(free)} parameters: {1e3 * gradient:.1f} ms, "
        f"without: {1e3 * plain:.1f} ms"
    )
    print(
        f"   against {1e3 * (len(free) + 1) * plain:.0f} ms for {len(free) + 1} runs of one-sided differences"
    )
    promise(gradient < (len(free) + 1) * plain, "exact derivatives take less time than one-sided differences")

    scenario = load_scenario(SCENARIO)
    simulate_scenario(scenario, 0.1)
    lockstep, result = best(lambda: simulate_scenario(scenario, scenario.duration), 5)
    messages = sum(len(series) for series in result.topics.values())
    print(f"lockstep, scenario 1: {scenario.duration:g} s ({messages} messages) in {1e3 * lockstep:.0f} ms")
    promise(
        scenario.duration > 100.0 * lockstep,
        f"{scenario.duration / lockstep:.0f} times real time, at least 100",
    )
    return promise.status


if __name__ == "__main__":
    sys.exit(main())
