"""MuJoCo's own system identification on a joint that MuJoCo simulated: the same job as `estimate` does.

With the packages that `mujoco.sysid` asks for installed (`pip install mujoco[sysid]`) it is that toolbox,
with its default optimiser; otherwise the same optimiser, `mujoco.minimize.least_squares`, on the same
residual, put together here. Either way: one simulation of the whole recording per evaluation, derivatives by
differences.
"""

from __future__ import annotations

import contextlib
import io
import time

import mujoco
import mujoco.rollout
import numpy as np
from hinge_plant import XML

NAMES = ("motor_inertia", "motor_damping", "stiffness", "arm_inertia",
         "j_joint.joint_damping.coefficient", "j_motor.coulomb_friction.torque")  # fmt: skip
#: Search between a tenth and ten times the start.
RANGE = 10.0


def changed(spec: mujoco.MjSpec, name: str, value: float) -> None:
    """Write one parameter, by our name, into a MuJoCo model."""
    drive, arm, motor, bend = spec.body("drive"), spec.body("arm"), spec.joint("motor"), spec.joint("bend")
    if name == "motor_inertia":
        drive.inertia = np.full(3, value)
    elif name == "arm_inertia":
        arm.inertia = np.full(3, value)
    elif name == "motor_damping":
        motor.damping = like(motor.damping, value)
    elif name == "stiffness":
        bend.stiffness = like(bend.stiffness, value)
    elif name == NAMES[4]:
        bend.damping = like(bend.damping, value)
    else:
        motor.frictionloss = value


def like(old, value: float):
    """The value in the shape of the old one: a number, or linear and further coefficients."""
    if np.ndim(old) == 0:
        return value
    new = np.zeros_like(np.asarray(old, dtype=float))
    new[0] = value
    return new


def identified(torque, angles, dt: float, start: dict[str, float]) -> tuple[dict[str, float], float, str]:
    """Values by name, CPU time in s, and with what, of torque (n,) and angles (n, 2) from start values."""
    sensed = np.column_stack([angles[:, 0], angles[:, 1] - angles[:, 0]])
    spec = mujoco.MjSpec.from_string(XML.format(step=dt))
    with_toolbox = hasattr(getattr(mujoco, "sysid", None) or _toolbox(), "optimize")
    begun = time.process_time()
    values = (_by_toolbox if with_toolbox else _by_minimize)(spec, torque, sensed, dt, start)
    name = "mujoco.sysid" if with_toolbox else "mujoco.minimize"
    found = dict(zip(NAMES, map(float, values), strict=True))
    return found, time.process_time() - begun, f"{name} {mujoco.__version__}"


def _toolbox():
    try:
        import mujoco.sysid
    except ImportError:
        return None
    return mujoco.sysid


def _by_toolbox(spec, torque, sensed, dt, start):
    sysid = _toolbox()
    model = spec.compile()
    times = dt * np.arange(len(torque))
    control = sysid.TimeSeries.from_control_names(times, torque[:, None], model, names=["torque"])
    data = sysid.TimeSeries.from_names(times, sensed, model, names=["motor", "bend"])
    parameters = sysid.ParameterDict()
    for name in NAMES:
        value = start[name]
        parameters.add(sysid.Parameter(
            name, value, value / RANGE, value * RANGE,
            modifier=lambda s, p, n=name: changed(s, n, float(p.value[0])),
        ))  # fmt: skip
    sequences = sysid.ModelSequences(
        "hinges", spec, "recording", sysid.create_initial_state(model, np.zeros(2)), control, data
    )
    residual = sysid.build_residual_fn(models_sequences=[sequences], n_threads=1)
    with contextlib.redirect_stdout(io.StringIO()):
        found, _ = sysid.optimize(parameters, residual, optimizer="mujoco", verbose=False)
    return found.as_vector()


def _by_minimize(spec, torque, sensed, dt, start):
    from mujoco import minimize

    control, spread = torque[:, None], sensed.std(axis=0)

    def residual(x):
        columns = []
        for values in np.atleast_2d(x.T):
            for name, value in zip(NAMES, values, strict=True):
                changed(spec, name, float(value))
            model = spec.compile()
            state = np.zeros(1 + model.nq + model.nv)
            _, sensors = mujoco.rollout.rollout(model, mujoco.MjData(model), state, control)
            # Sensors are those before each step but the first: of sample k + 1 after the k-th input.
            columns.append(((sensors[0][:-1] - sensed[1:]) / spread).ravel())
        return np.array(columns).T

    first = np.array([start[n] for n in NAMES])
    bounds = [first / RANGE, first * RANGE]
    x, _ = minimize.least_squares(first, residual, bounds=bounds, verbose=minimize.Verbosity.SILENT)
    return np.ravel(x)
