"""Draws docs/graph.svg, the nodes and topics of scenario 1: `python docs/examples/graph.py`."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import matplotlib.patches

matplotlib.use("svg")
from matplotlib.figure import Figure

BOXES = {
    "signal_generator": (0.5, 3.35, "#F3E6C8"),
    "omni_driver\nor omni_sim": (0.5, 1.7, "#D7E7F5"),
    "force_controller": (4.5, 1.7, "#DDEFD9"),
    "sfj_driver\nor sfj_sim": (8.5, 1.7, "#D7E7F5"),
    "recorder": (4.5, 0.1, "#EEEEEE"),
}
"""Node: left edge, lower edge, colour; each is 2.4 by 0.9."""
WIDTH, HEIGHT = 2.4, 0.9
ARROWS = (
    ((2.9, 3.8), (5.3, 2.6), "/reference (instead of the hand)", (5.75, 3.45)),
    ((2.9, 2.35), (4.5, 2.35), "/omni/\njoint_states", (3.7, 2.72)),
    ((4.5, 1.95), (2.9, 1.95), "/omni/\neffort_command", (3.7, 1.55)),
    ((8.5, 2.35), (6.9, 2.35), "/sfj/\njoint_states", (7.7, 2.72)),
    ((6.9, 1.95), (8.5, 1.95), "/sfj/\neffort_command", (7.7, 1.55)),
    ((5.7, 1.7), (5.7, 1.0), "all topics", (6.25, 1.35)),
)
NOTES = ((1.7, 1.35, "master: the hand holds it"), (9.7, 1.35, "slave: touches the environment"),
         (8.95, 0.55, "recording (MCAP) → verify, estimate, diagnose"))  # fmt: skip


def main() -> None:
    """Write the picture beside the docs."""
    figure = Figure(figsize=(9.0, 3.6))
    axis = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axis.set(xlim=(0.2, 11.2), ylim=(0.0, 4.4))
    axis.axis("off")
    for name, (x, y, colour) in BOXES.items():
        axis.add_patch(matplotlib.patches.FancyBboxPatch(
            (x + 0.05, y + 0.05), WIDTH - 0.1, HEIGHT - 0.1, boxstyle="round,pad=0.05",
            facecolor=colour, edgecolor="0.3",
        ))  # fmt: skip
        axis.text(x + WIDTH / 2, y + HEIGHT / 2, name, ha="center", va="center", family="monospace", size=9)
    for start, end, label, where in ARROWS:
        axis.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": "0.2"})
        axis.text(*where, label, ha="center", va="center", size=8)
    for x, y, text in NOTES:
        axis.text(x, y, text, ha="center", va="center", size=8.5, style="italic")
    figure.savefig(Path(__file__).resolve().parents[1] / "graph.svg", metadata={"Date": None})


if __name__ == "__main__":
    main()
