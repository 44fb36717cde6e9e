"""The correlations of one-step prediction errors, drawn with their bounds."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from haptic_teleop_sysid.report import Panel, Series, stacked_panels
from haptic_teleop_sysid.residuals import Residuals


def residual_picture(residuals: list[Residuals], dt: float) -> Figure:
    """Auto- and cross-correlation with their 99 % bounds."""
    panels = []
    for one in residuals:
        time = np.asarray(one.lags * dt, dtype=np.float64)
        bounds = (-one.bound, one.bound)
        later = one.lags > 0
        panels.append(
            Panel(
                f"{one.signal}: error with itself later",
                "1",
                [Series("", time[later], np.asarray(one.auto[later]), colour=1)],
                guides=bounds,
            )
        )
        panels.append(
            Panel(
                f"{one.signal}: input with error later (left of 0: feedback)",
                "1",
                [Series("", time, one.cross, colour=2)],
                guides=bounds,
            )
        )
    return stacked_panels(panels, x_label="lag (s)", height=1.4)
