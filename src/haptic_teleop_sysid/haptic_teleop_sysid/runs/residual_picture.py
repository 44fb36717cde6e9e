"""The correlations of one-step prediction errors, drawn with their bounds."""

from __future__ import annotations

import numpy as np

from haptic_teleop_sysid.estimation.residuals import Residuals
from haptic_teleop_sysid.report import Panel, Plot, Series


def residual_picture(residuals: list[Residuals], dt: float) -> Plot:
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
                [Series("", time[later], np.asarray(one.auto[later]))],
                guides=bounds,
            )
        )
        panels.append(
            Panel(
                f"{one.signal}: input with error later (left of 0: feedback)",
                "1",
                [Series("", time, one.cross, "input")],
                guides=bounds,
            )
        )
    return Plot(panels, x_label="lag (s)")
