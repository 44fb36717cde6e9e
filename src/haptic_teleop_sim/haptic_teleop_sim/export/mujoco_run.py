"""An exported file simulated where it is meant to go: MuJoCo reads MJCF and URDF alike."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.errors import ModelError

from ..mujoco_robot import TIMESTEP, mujoco_module

Array = NDArray[np.float64]


def run_in_mujoco(
    text: str, joint: str, input_: Array, dt: float, per_input: float = 1.0
) -> dict[str, Array]:
    """Response to `input_` (n,), held over each sample of dt, s, from rest: `motor_position`,
    `motor_velocity` and, of a flexible joint in MJCF, `arm_position`, `arm_velocity`, each (n,), before the
    input of its sample acts.

    per_input: N·m per input, for a URDF, whose joint takes efforts. The engine's time step is the file's, or
    a little less so that a sample holds a whole number (1e-4 s for a URDF, which has none). Raises
    ConfigurationError without MuJoCo, ModelError where it refuses the file.
    """
    mujoco = mujoco_module()
    try:
        model = mujoco.MjModel.from_xml_string(text)
    except ValueError as error:
        raise ModelError(
            f"MuJoCo {mujoco.__version__} refuses the exported file ({str(error).strip()}): "
            "install a newer MuJoCo."
        ) from None
    step = float(model.opt.timestep) if model.nu else TIMESTEP
    substeps = max(1, math.ceil(dt / step - 1e-9))
    model.opt.timestep = dt / substeps
    data = mujoco.MjData(model)
    names = _readers(model, joint)
    found = {name: np.empty(len(input_)) for name in names}
    limit = model.jnt_actfrcrange[0] if model.jnt_actfrclimited[0] else (-math.inf, math.inf)
    for i, value in enumerate(np.asarray(input_, dtype=np.float64)):
        if model.nsensor:
            mujoco.mj_forward(model, data)
        for name, (array, place) in names.items():
            found[name][i] = getattr(data, array)[place]
        if model.nu:
            data.ctrl[0] = value
        else:
            data.qfrc_applied[0] = min(max(per_input * value, limit[0]), limit[1])
        mujoco.mj_step(model, data, substeps)
    return found


def _readers(model: Any, joint: str) -> dict[str, tuple[str, int]]:
    """Which place of which array of the engine's data holds a signal."""
    if model.nsensor == 0:
        return {"motor_position": ("qpos", 0), "motor_velocity": ("qvel", 0)}
    places = ("motor", "arm") if model.nsensor > 2 else ("motor",)
    return {
        f"{place}_{signal}": ("sensordata", int(model.sensor(f"{joint}_{place}.{signal}").adr[0]))
        for place in places
        for signal in ("position", "velocity")
    }
