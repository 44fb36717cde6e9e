"""Draws docs/stage.svg, the parts of a stage and what they are called: `python docs/examples/stage.py`."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import matplotlib.patches
import numpy as np

matplotlib.use("svg")
from matplotlib.figure import Figure

BLOCKS = {
    "drive": (2.0, 2.2, "#D7E7F5", "motor with gear\n$J_m$, $B_m$, angle $\\theta_m$"),
    "arm": (7.6, 2.2, "#DDEFD9", "what the spring moves\n$J_a$, $B_a$, angle $\\theta_a$"),
}
"""Left edge, width, colour and what it is."""
LOW, HIGH = 1.0, 2.6


def main() -> None:
    """Write the picture beside the docs."""
    figure = Figure(figsize=(9.0, 3.0))
    axis = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axis.set(xlim=(0.0, 12.6), ylim=(0.0, 3.9))
    axis.axis("off")
    for name, (x, width, colour, what) in BLOCKS.items():
        axis.add_patch(matplotlib.patches.Rectangle(
            (x, LOW), width, HIGH - LOW, facecolor=colour, edgecolor="0.3",
        ))  # fmt: skip
        axis.text(x + width / 2, 2.25, name, ha="center", va="center", size=12, weight="bold")
        axis.text(x + width / 2, 1.55, what, ha="center", va="center", size=9)
    middle = 0.5 * (LOW + HIGH)
    along = np.linspace(4.8, 7.0, 13)
    swing = 0.25 * np.array([0, *[1, -1] * 5, 1, 0])
    axis.plot([4.2, *along, 7.6], [middle, *(middle + swing), middle], color="0.2", linewidth=1.5)
    axis.text(5.9, 2.55, "joint: a spring", ha="center", size=10, weight="bold")
    axis.text(5.9, 1.05, "stiffness $K_s$\ndeflection $\\theta_m - \\theta_a$", ha="center", size=9)
    axis.text(
        5.9, 3.35, "$T_e = K_s\\,(\\theta_m - \\theta_a)$: the torque in the spring,\n"
        "at rest the one on the environment", ha="center", va="center", size=9, style="italic",
    )  # fmt: skip
    axis.annotate("", (2.0, middle), (0.7, middle), arrowprops={"arrowstyle": "-|>", "color": "0.2"})
    axis.text(0.95, 2.2, "current i,\ntorque $K_t\\,i$", ha="center", va="center", size=9)
    axis.plot([10.7, 10.7], [LOW - 0.2, HIGH + 0.2], color="0.2", linewidth=4)
    axis.text(10.95, middle, "environment:\na wall, or\nnothing", ha="left", va="center", size=9)
    axis.annotate("", (10.65, middle), (9.8, middle), arrowprops={"arrowstyle": "-|>", "color": "0.2"})
    axis.annotate("", (1.9, 0.45), (9.9, 0.45), arrowprops={"arrowstyle": "<->", "color": "0.5"})
    axis.text(5.9, 0.2, "one stage; the 2DSFJ has two", ha="center", va="center", size=9)
    figure.savefig(Path(__file__).resolve().parents[1] / "stage.svg", metadata={"Date": None})


if __name__ == "__main__":
    main()
