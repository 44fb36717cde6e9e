"""A picture of commands over time, to look at before anything moves."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.signals.settings import SignalSettings

Array = NDArray[np.float64]

LONGEST = 100.0
"""s, what is drawn of an unlimited signal (as in the thesis' own tool)."""

MOST_POINTS = 50_000


def times_to_draw(end: float, rate: float, span: float | None = None) -> Array:
    """Times (n,), s, from 0 to `span` (default: a little beyond `end`, at most LONGEST), at `rate`, Hz, or as
    dense as MOST_POINTS allow. Raises ConfigurationError for a span that is not finite and above 0."""
    if span is None:
        span = min(end * 1.05, LONGEST) or 1.0
    if not (math.isfinite(span) and span > 0.0):
        raise ConfigurationError(f"preview: span is {span} s; choose a finite time above 0.")
    return np.linspace(0.0, span, min(MOST_POINTS, int(span * rate) + 2))


def draw(
    path: Path, times: Array, commands: Array, settings: Mapping[str, SignalSettings], label: str
) -> Path:
    """Write a .png or .svg of `commands` (n, stages) at `times` (n,), s, one panel for each stage of
    `settings` with its saturation; `label`: quantity and unit. Returns the path.

    Raises ConfigurationError for another suffix or a place that cannot be written.
    """
    if path.suffix.lower() not in (".png", ".svg"):
        raise ConfigurationError(f"{path}: a preview is a .png or a .svg; give it one of these endings.")
    from matplotlib.figure import Figure  # importing it takes half a second

    figure = Figure(figsize=(9.0, 2.6 * len(settings)), layout="constrained")
    axes = figure.subplots(len(settings), 1, sharex=True, squeeze=False)[:, 0]
    for axis, (stage, own), column in zip(axes, settings.items(), commands.T, strict=True):
        axis.plot(times, column, linewidth=1.0)
        for limit in (-own.saturation, own.saturation):
            if math.isfinite(limit):
                axis.axhline(limit, color="tab:red", linestyle=":", linewidth=0.8)
        axis.set_title(stage if own.enabled else f"{stage} (not enabled)", loc="left")
        axis.set_ylabel(label)
        axis.grid(True, alpha=0.3)
    axes[-1].set_xlabel("time / s")
    try:
        figure.savefig(path, dpi=110)
    except OSError as error:
        raise ConfigurationError(
            f"{path}: cannot be written ({error.strerror}); choose another place."
        ) from error
    return path
