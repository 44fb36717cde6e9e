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
from haptic_teleop_sysid.simulation.fit import choose_windows, simulated_fit

EXAMPLES = Path(__file__).resolve().parent
SHOWN = (2.4, 3.6)  # s
#: Colours that people with any colour vision tell apart (Okabe and Ito).
MODELS = (("the lab's model", "#D55E00", "--"), ("with the backlash that was found", "#0072B2", "-"))


def main(diagnosis: Path) -> None:
    """Measured and simulated velocity of the arm on the recording that nothing was fitted to."""
    files = (EXAMPLES / "stage2" / "model.yaml", diagnosis / "augmented_model.yaml")
    models = [load_model(file) for file in files]
    data = load_dataset(read_recording(EXAMPLES / "stage2" / "check"), models[0])
    windows = choose_windows(models[0], data)
    figure = Figure(figsize=(8.0, 3.0), layout="constrained")
    axis = figure.add_subplot()
    part = (data.time >= SHOWN[0]) & (data.time <= SHOWN[1])
    axis.plot(
        data.time[part], data.arm_velocity[part], color="0.1", linewidth=2.6, alpha=0.45, label="measured"
    )
    for model, (label, colour, line) in zip(models, MODELS, strict=True):
        fit = simulated_fit(model, data, windows)
        shown = fit.simulated["stage2_arm.velocity"]
        percent = fit.percent["stage2_arm.velocity"]
        axis.plot(
            data.time[part],
            shown[part],
            line,
            color=colour,
            linewidth=1.3,
            label=f"{label}: fit {percent:.0f} %",
        )
    axis.set_xlabel("time / s")
    axis.set_ylabel("velocity of the arm / (rad/s)")
    axis.spines[["top", "right"]].set_visible(False)
    figure.legend(loc="outside upper center", ncols=3, frameon=False)
    figure.savefig(EXAMPLES.parent / "first_hour.svg", metadata={"Date": None})


if __name__ == "__main__":
    main(Path(sys.argv[1]))
