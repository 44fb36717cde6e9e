"""How fast identification is: reading, one simulation, one gradient, a whole estimate; against the obvious
way and against MuJoCo's.

Times are CPU seconds of one thread, so that what else the machine does counts little; the best of several
repetitions where that is cheap. The recording is the Omni's Y axis in closed loop, 60 s at 1 kHz with encoder
steps and a disturbance of 1 %, and its model has nine free parameters, started 30 % off.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from _promises import Promises
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from haptic_teleop_control.recording import read_recording, write_recording
from haptic_teleop_sim.kernel import pack, predict, simulate
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.records import with_trusted_input
from haptic_teleop_sysid.estimation.strategies import estimate
from haptic_teleop_sysid.recordings.dataset import load_dataset

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "unit"))
from identification_plants import AXIS, axis_recording, off

SECONDS, DT = 60.0, 1e-3
STEADY = 5.0
"""s of the recording that the general solver is timed on."""
ITERATIONS = 30
"""Of the obvious way, after which it is stopped."""


def clocked(function, repetitions=1):
    """Least CPU time of several calls, s, and the last result."""
    times = []
    for _ in range(repetitions):
        start = time.process_time()
        result = function()
        times.append(time.process_time() - start)
    return min(times), result


def solved(model: Model, torque, seconds):
    """The axis by a general solver, its equations written as one would, the input held over each sample."""
    m, n = model.parameters, round(seconds / DT)
    p = {name.split(".")[-1]: value for name, value in model.parameter_values().items() if "." in name}

    def rates(t, x):
        held = torque[min(int(t / DT), n - 1)]
        bent = m["stiffness"] * (x[0] - x[1]) + p["coefficient"] * (x[2] - x[3])
        fall = (p["breakaway"] - p["coulomb"]) / np.cosh(x[2] / p["velocity"])
        rub = (p["coulomb"] + fall) * np.tanh(x[2] / p["smoothing"]) + m["motor_damping"] * x[2]
        return [x[2], x[3], (held - rub - bent) / m["motor_inertia"], bent / m["arm_inertia"]]

    t = DT * np.arange(n)
    return solve_ivp(rates, (0.0, t[-1]), np.zeros(4), t_eval=t, rtol=1e-6, atol=1e-9, max_step=5 * DT)


def obvious_way(data, start: Model, names):
    """`least_squares` with derivatives by differences on the freely simulated angle, evaluations counted.

    Run with our simulation in place of the solver: the same numbers in a time that one can wait for."""
    first = np.array([start.parameter_values()[n] for n in names])

    def residual(x):
        model = start.with_values(dict(zip(names, x * first, strict=True)))
        run = simulate(pack(model), data.input, data.dt, np.zeros(4))
        return np.clip(run.motor_position - data.motor_position, -1e3, 1e3)

    found = least_squares(residual, np.ones(len(names)), bounds=(0.05, 20.0), max_nfev=ITERATIONS)
    return dict(zip(names, found.x * first, strict=True)), found.nfev + len(names) * (found.njev or 0)


def errors(values, truth):
    """Median and worst relative error in percent, in words."""
    apart = 100.0 * np.abs([values[n] / v - 1.0 for n, v in truth.items()])
    return f"errors: median {np.median(apart):.2g} %, worst {apart.max():.2g} %"


def against_mujoco(promise) -> None:
    """Two hinges that MuJoCo simulated: its own identification and ours."""
    try:
        import _mujoco_identification as theirs
        from hinge_plant import TRUTH, hinge_model, hinge_motion, hinge_recording
    except ImportError as missing:
        print(f"MuJoCo's own identification: left out, because {missing.name} is not installed")
        return
    print("two hinges simulated by MuJoCo in steps of 0.1 ms, 60 s at 1 kHz, six parameters from 30 % off:")
    start = {n: v * f for (n, v), f in zip(TRUTH.items(), (1.3, 0.7) * 3, strict=True)}
    narrow = {"j_motor.coulomb_friction.smoothing": (2e-3, 1.0)}
    for disturbance in (0.0, 0.01):
        torque, angles = hinge_motion(1, SECONDS, DT, disturbance=disturbance)
        data = load_dataset(hinge_recording(torque, angles, DT), hinge_model())
        estimate(hinge_model(start), [data.between(0.0, 2.0)], limits=narrow)
        ours, found = clocked(lambda d=data: estimate(hinge_model(start), [d], limits=narrow))
        values, seconds, name = theirs.identified(torque, angles, DT, start)
        print(f"   disturbance {100 * disturbance:g} %")
        print(f"      estimate: {ours:.1f} s, {errors(found.model.parameter_values(), TRUTH)}")
        print(f"      {name}, one engine step a sample: {seconds:.1f} s, {errors(values, TRUTH)}")
        promise(ours < seconds, f"{seconds / ours:.1f} times as fast as the engine's own")


def main() -> int:
    promise = Promises()
    recording, start = axis_recording(seed=1, seconds=SECONDS, rms=0.1), off(AXIS, 1)
    names = start.free_parameters()
    assert len(names) == 9, names
    with tempfile.TemporaryDirectory() as folder:
        bag = write_recording(Path(folder) / "bag", recording.topics, {}, recording.experiment)
        read, data = clocked(lambda: load_dataset(read_recording(bag), start), 3)
    print(f"60 s at 1 kHz, {len(data)} states of three joints and as many commands, MCAP to data set: "
          f"{read:.2f} s")  # fmt: skip
    promise(read < 1.0, "well under a second")

    data = with_trusted_input(data)
    packed, measured = pack(AXIS), np.column_stack([data.motor_position, np.full(len(data), np.nan)])
    one, _ = clocked(lambda: simulate(packed, data.input, DT), 10)
    gradient, _ = clocked(lambda: predict(packed, data.input, measured, DT, names), 10)
    print(f"one simulation: {1e3 * one:.1f} ms; one gradient by nine parameters: {1e3 * gradient:.1f} ms")
    print(f"   (reference: 11 and 30 ms; by differences a gradient takes {1e4 * one:.0f} ms)")
    promise(gradient < 10.0 * one, "the gradient takes less time than differences")

    truth = {n: AXIS.parameter_values()[n] for n in names}
    estimate(start, [data.between(0.0, 2.0)])
    ours, found = clocked(lambda: estimate(start, [data]), 2)
    print(f"estimate with noise model and standard errors: {ours:.1f} s, "
          f"{errors(found.model.parameter_values(), truth)}")  # fmt: skip
    promise(found.converged and ours <= 5.0, "an estimate of nine parameters in at most 5 s")

    solver, run = clocked(lambda: solved(AXIS, data.input, STEADY))
    check = simulate(packed, data.input[: round(STEADY / DT)], DT, np.zeros(4)).motor_position
    print(f"solve_ivp, {STEADY:g} s of it: {solver:.1f} s, the same angle within "
          f"{np.max(np.abs(run.y[0] - check)) / np.ptp(check):.1e} of its range")  # fmt: skip
    values, evaluations = obvious_way(data, start, names)
    theirs = evaluations * solver * SECONDS / STEADY
    print(f"least_squares over solve_ivp, stopped after {ITERATIONS} iterations: {evaluations} evaluations "
          f"of 60 s\n   (counted with our simulation in the solver's place) make {theirs / 60.0:.0f} min, "
          f"extrapolated;\n   {errors(values, truth)}")  # fmt: skip
    promise(theirs > 100.0 * ours, f"{theirs / ours:.0f} times as fast as the obvious way, at least 100")

    against_mujoco(promise)
    return promise.status


if __name__ == "__main__":
    sys.exit(main())
