"""A picture of what a signal generator will do, to look at before anything moves."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from haptic_teleop_control.errors import ConfigurationError

if TYPE_CHECKING:
    from haptic_teleop_control.signals.generator import SignalGenerator

LONGEST = 100.0
"""s, what is drawn of an unlimited signal (as in the thesis' own tool)."""

MOST_POINTS = 50_000


def draw(generator: SignalGenerator, path: Path, span: float | None = None) -> Path:
    """Write the picture; see `SignalGenerator.preview`."""
    if path.suffix.lower() not in (".png", ".svg"):
        raise ConfigurationError(f"{path}: a preview is a .png or a .svg; give it one of these endings.")
    if span is None:
        span = min(generator.end * 1.05, LONGEST) or 1.0
    if not (math.isfinite(span) and span > 0.0):
        raise ConfigurationError(f"preview: span is {span} s; choose a finite time above 0.")
    points = min(MOST_POINTS, int(span * generator.rate) + 2)
    times = np.linspace(0.0, span, points)
    values = generator.series(times)

    figure = Figure(figsize=(9.0, 2.6 * len(generator.stages)), layout="constrained")
    axes = figure.subplots(len(generator.stages), 1, sharex=True, squeeze=False)[:, 0]
    for axis, (stage, settings), column in zip(axes, generator.settings.items(), values.T, strict=True):
        axis.plot(times, column, linewidth=1.0)
        for limit in (-settings.saturation, settings.saturation):
            if math.isfinite(limit):
                axis.axhline(limit, color="tab:red", linestyle=":", linewidth=0.8)
        axis.set_title(stage if settings.enabled else f"{stage} (not enabled)", loc="left")
        axis.set_ylabel(f"{generator.kind} / {generator.unit}")
        axis.grid(True, alpha=0.3)
    axes[-1].set_xlabel("time / s")
    try:
        figure.savefig(path, dpi=110)
    except OSError as error:
        raise ConfigurationError(
            f"{path}: cannot be written ({error.strerror}); choose another place."
        ) from error
    return path
