"""What an estimate from recordings is: the estimate, what it was made from, and how well it simulates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from haptic_teleop_sysid.estimation.residuals import Residuals
from haptic_teleop_sysid.estimation.result import Estimate
from haptic_teleop_sysid.recordings.dataset import DataSet
from haptic_teleop_sysid.recordings.parameter_units import Units
from haptic_teleop_sysid.recordings.small_motion import hardly_moving, judged
from haptic_teleop_sysid.simulation.fit import SimulatedFit


@dataclass(frozen=True)
class Result:
    """Everything `estimate` found. Data sets by bag, `validation` names those not used for the fit; fits by
    (start or estimate, bag); `residuals` by bag; `told` by bag: what was done to the data set."""

    estimate: Estimate
    data: dict[str, DataSet]
    validation: tuple[str, ...]
    fits: dict[tuple[str, str], SimulatedFit]
    residuals: dict[str, list[Residuals]]
    told: dict[str, list[str]]

    def judging(self) -> list[str]:
        """The recordings that judge: those that were not used, or all where there are none."""
        return [b for b in self.data if b in self.validation] or list(self.data)

    def mean_fit(self, which: str) -> float:
        """Mean fit of "start" or "estimate" over the signals of the recordings that judge, percent."""
        bags = self.judging()
        fits = [judged(self.fits[which, b].percent, hardly_moving([self.data[b]])) for b in bags]
        return float(np.mean([p for found in fits for p in found.values()]))


def units_of(result: Result) -> Units:
    """The units of the machine that was estimated."""
    return Units.of(result.estimate.model, next(iter(result.data.values())))
