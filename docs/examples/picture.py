"""Draws docs/first_hour.svg: `python docs/examples/picture.py DIAGNOSIS` after the diagnosis of
docs/first_hour.md, from the repository's top."""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("svg")
from matplotlib.figure import Figure

from haptic_teleop_control.recording import read_recording
from haptic_teleop_sim.model import load_model
from haptic_teleop_sysid.recordings.dataset import load_dataset
from haptic_teleop_sysid.report.roles import ROLES
from haptic_teleop_sysid.simulation.fit import choose_windows, simulated_fit

EXAMPLES = Path(__file__).resolve().parent
SHOWN = (2.4, 3.6)  # s
#: What each model means, drawn as the pages do.
MODELS = (("the lab's model", "given"), ("with the backlash that was found", "augmented"))


def main(diagnosis: Path) -> None:
    """Measured and simulated velocity of the arm on the recording that nothing was fitted to."""
    files = (EXAMPLES / "stage2" / "model.yaml", diagnosis / "augmented_model.yaml")
    models = [load_model(file) for file in files]
    data = load_dataset(read_recording(EXAMPLES / "stage2" / "check"), models[0])
    windows = choose_windows(models[0], data)
    figure = Figure(figsize=(8.0, 3.0), layout="constrained")
    axis = figure.add_subplot()
    part = (data.time >= SHOWN[0]) & (data.time <= SHOWN[1])
    lines = [(data.arm_velocity, "measured", "measured")]
    for model, (label, role) in zip(models, MODELS, strict=True):
        fit = simulated_fit(model, data, windows)
        percent = fit.percent["stage2_arm.velocity"]
        lines.append((fit.simulated["stage2_arm.velocity"], f"{label}: fit {percent:.0f} %", role))
    for values, label, name in lines:
        role = ROLES[name]
        dash = (0, tuple(d / role.width for d in role.dash)) if role.dash else "-"
        axis.plot(
            data.time[part],
            values[part],
            color=role.light,
            linewidth=0.75 * role.width,
            linestyle=dash,
            label=label,
            zorder=3 if name == "measured" else 2,
        )
    axis.set_xlabel("time / s")
    axis.set_ylabel("velocity of the arm / (rad/s)")
    axis.spines[["top", "right"]].set_visible(False)
    figure.legend(loc="outside upper center", ncols=3, frameon=False)
    figure.savefig(EXAMPLES.parent / "first_hour.svg", metadata={"Date": None})


if __name__ == "__main__":
    main(Path(sys.argv[1]))
