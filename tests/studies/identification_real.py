"""The real recordings: parameters and fits beside what is published of them (identification_measured.md).

    python tests/studies/identification_real.py FOLDER

FOLDER holds `dfki` and `kr300`, each with `estimation` and `validation`. The pendulum is judged by the
simulated angle, as published. The robot's axis is judged by the torque that its motion asks for (inverse
dynamics), as published for either run, and by the simulated angle.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from scipy.signal import savgol_filter

from haptic_teleop_control.recording import read_recording
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.strategies import estimate
from haptic_teleop_sysid.recordings.dataset import DataSet, load_dataset
from haptic_teleop_sysid.simulation.fit import choose_windows, fit_percent, simulated_fit

TOPIC = "/plant/joint_states"
IO = {"input": {"topic": TOPIC, "joint": "j", "field": "effort"}, "motor": {"topic": TOPIC, "joint": "j"},
      "arm": None}  # fmt: skip
SMOOTHING = 0.1
"""s over which the angle is smoothed for its acceleration."""


def body(inertia: float, damping: float, *effects: Effect) -> Model:
    """A rigid body with effects, its input in N·m."""
    parameters = {"torque_constant": 1.0, "motor_inertia": inertia, "motor_damping": damping}
    return Model("generic", "j", "rigid_body", parameters, fixed=("torque_constant",), effects=effects, io=IO)


GRAVITY = Effect("gravity", "j_motor", {"torque": 2.0})
COULOMB = Effect("coulomb_friction", "j_motor", {"torque": 0.1})
MACHINES = {
    "dfki": {
        "viscous": body(0.2, 0.05),
        "gravity": body(0.2, 0.05, GRAVITY),
        "gravity, Coulomb": body(0.2, 0.0, GRAVITY, COULOMB),
    },
    "kr300": {
        "viscous": body(1500.0, 2000.0),
        "Coulomb": body(1500.0, 2000.0, Effect("coulomb_friction", "j_motor", {"torque": 200.0})),
        "asymmetric": body(
            1500.0, 2000.0, Effect("asymmetric_friction", "j_motor", {"positive": 200.0, "negative": 200.0})
        ),
    },
}  # fmt: skip


def torque_fit(model: Model, data: DataSet) -> float:
    """Fit in percent of the torque that the measured motion asks for, friction by the sign of the speed."""
    samples = round(SMOOTHING / data.dt) | 1
    speed, acceleration = (
        savgol_filter(data.motor_position, samples, 3, deriv=k, delta=data.dt) for k in (1, 2)
    )
    values = model.parameter_values()
    torque = values["motor_inertia"] * acceleration + values["motor_damping"] * speed
    for effect in model.effects:
        sizes = effect.values
        one = sizes.get("torque", 0.0)
        torque += np.where(speed > 0.0, sizes.get("positive", one), -sizes.get("negative", one))
    return fit_percent(data.input[samples:-samples], torque[samples:-samples])


def lines(machine: str, name: str, folder: Path, learned: str) -> None:
    """Print a row for each method: a model estimated on one part, judged on both."""
    start = MACHINES[machine][name]
    data = {
        part: load_dataset(read_recording(folder / machine / part), start)
        for part in ("estimation", "validation")
    }
    for method in ("prediction-error", "output-error", "progressive"):
        found = estimate(start, [data[learned]], method)
        values = found.model.parameter_values()
        told = ", ".join(f"{n.split('.')[-1]} {values[n]:.4g}" for n in start.free_parameters())
        fits = []
        for part in data.values():
            simulated = simulated_fit(found.model, part, choose_windows(start, part)).percent
            fits.append(f"{simulated['j_motor.position']:.1f}")
            if machine == "kr300":
                fits[-1] += f" (torque {torque_fit(found.model, part):.1f})"
        doubt = "" if found.converged else ", did not arrive"
        doubt += ", looks ahead" if found.misled else ""
        row = (machine, name, learned, method + doubt, told, *fits)
        print(f"| {' | '.join(row)} |", flush=True)


if __name__ == "__main__":
    print("| machine | model | estimated on | method | parameters | fit, estimation | fit, validation |")
    print("|---|---|---|---|---|---|---|")
    for machine, models in MACHINES.items():
        for name in models:
            for part in ("estimation", "validation") if machine == "kr300" else ("estimation",):
                lines(machine, name, Path(sys.argv[1]), part)
