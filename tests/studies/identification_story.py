"""The thesis' story on simulated plants with the friction of equation (22): which models verify how well.

    python tests/studies/identification_story.py

Omni: linear against nonlinear model (thesis 3.2.4: 44.5 to 46.8 % against 69.8 to 71 %). 2DSFJ: initial
values, damping only, all parameters of the linear model (thesis figure 18; its best 65.2 % motor, 72.7 %
arm).
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "unit"))
from identification_plants import AXIS, STAGE, axis_recording, stage_recording

from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.progressive import without_nonlinear
from haptic_teleop_sysid.estimation.records import with_trusted_input
from haptic_teleop_sysid.estimation.strategies import estimate
from haptic_teleop_sysid.recordings.dataset import DataSet, load_dataset
from haptic_teleop_sysid.simulation.fit import simulated_fit
from haptic_teleop_sysid.simulation.windows import cut

SLOW, QUICK = (0.1, 0.6), (0.8, 2.5)
RUBBING = AXIS.with_values({"omni_y_motor.stribeck_friction.coulomb": 0.03,
                            "omni_y_motor.stribeck_friction.breakaway": 0.045})  # fmt: skip
STICKY = STAGE.with_effects(
    Effect("stribeck_friction", "stage1_motor",
           {"coulomb": 0.4, "breakaway": 0.6, "velocity": 0.2, "smoothing": 0.02})
)  # fmt: skip
#: What a manufacturer's data would say: off by up to a third, friction left out.
INITIAL = STAGE.with_values({"torque_constant": 7.5, "motor_inertia": 0.05, "motor_damping": 4.0,
                             "arm_inertia": 0.2, "arm_damping": 0.05})  # fmt: skip


def fits(model: Model, dataset: DataSet) -> dict[str, float]:
    """Simulated fit in percent over windows of 4 s, by signal."""
    return simulated_fit(model, dataset, cut(dataset, 4.0, "")).percent


def omni(method: str = "prediction-error", seconds: float = 30.0) -> dict[tuple[str, str], dict[str, float]]:
    """Verification fits by (model, band): the models estimated on one recording, judged on two others."""

    def data(seed: int, band: tuple[float, float]) -> DataSet:
        recording = axis_recording(RUBBING, seed, seconds, band=band)
        return with_trusted_input(load_dataset(recording, AXIS))

    learned = data(1, (0.1, 2.5))
    checked = {"whole band": data(2, (0.1, 2.5)), "slow": data(3, SLOW), "quick": data(4, QUICK)}
    found = {}
    for name, start in (("linear", without_nonlinear(AXIS)), ("nonlinear", AXIS)):
        model = estimate(start, [learned], method).model
        for band, dataset in checked.items():
            found[name, band] = fits(model, dataset)
    return found


def stage(method: str = "output-error", seconds: float = 30.0) -> dict[str, dict[str, float]]:
    """Verification fits by model of stage 1."""

    def data(seed: int) -> DataSet:
        recording = stage_recording(STICKY, seed, seconds, rms=0.2, band=(0.1, 5.0))
        return with_trusted_input(load_dataset(recording, STAGE))

    learned, checked = data(1), data(2)
    everything = tuple(STAGE.parameters)
    damping = replace(INITIAL, fixed=tuple(n for n in everything if not n.endswith("_damping")))
    whole = STICKY.with_values({**INITIAL.parameters})
    models = {
        "initial values": INITIAL,
        "damping only": estimate(damping, [learned], method).model,
        "all parameters": estimate(INITIAL, [learned], method).model,
        "all, and friction of equation (22)": estimate(whole, [learned]).model,
    }
    return {name: fits(model, checked) for name, model in models.items()}


if __name__ == "__main__":
    for method in ("prediction-error", "output-error", "progressive"):
        print(f"Omni Y, verification fit of the models estimated by {method}")
        for (model, band), percent in omni(method).items():
            print(f"  {model:10s} {band:10s} " + "  ".join(f"{k} {v:.1f} %" for k, v in percent.items()))
    print("2DSFJ stage 1, verification fit")
    for model, percent in stage().items():
        print(f"  {model:36s} " + "  ".join(f"{k} {v:.1f} %" for k, v in percent.items()))
