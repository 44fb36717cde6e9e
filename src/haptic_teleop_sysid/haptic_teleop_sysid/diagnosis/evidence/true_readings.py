"""How well the structure simulates recordings whose readings are corrected by an error that was drawn."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import FAILURES
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.whole_fit import fit_whole

from .proof import Course
from .reading_error import ReadingError

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Corrected:
    """Mean simulated fit of the validation recordings, percent, of the structure with what is named,
    estimated from readings ``as_read``, and as they are ``corrected``."""

    as_read: float
    corrected: float

    def content(self) -> dict[str, Any]:
        """What diagnosis.json says."""
        return {
            "what": "with readings that are corrected by that error, the structure with what is named "
            f"simulates the validation recordings at {self.corrected:.1f} instead of {self.as_read:.1f} %",
            "as_read": round(self.as_read, 2),
            "corrected": round(self.corrected, 2),
        }


def with_true_readings(
    error: ReadingError,
    baseline: Fit,
    named: Sequence[Effect],
    records: Sequence[Record],
    course: Course,
    count: int,
) -> Corrected | None:
    """What the correction is worth; ``records``: of the estimation; ``course``: of all recordings, of which
    ``count`` are the estimation's. None where a fit fails, or a simulation says nothing."""
    model = baseline.model.with_effects(*named)
    true = [replace(r, measured=_corrected(r.measured, error)) for r in records]
    data = tuple(
        replace(
            one,
            motor_position=error.true(one.motor_position),
            motor_velocity=one.motor_velocity * error.slope(one.motor_position),
        )
        for one in course.data
    )
    both = (records, course), (true, replace(course, data=data, known=deque(maxlen=1)))
    found = []
    try:
        for read, simulated in both:
            fit = fit_whole(model, baseline.noise, read)
            found.append(float(np.mean(simulated.percent(fit.model)[count:])))
    except FAILURES:
        return None
    return Corrected(*found) if all(map(math.isfinite, found)) else None


def _corrected(measured: FloatArray, error: ReadingError) -> FloatArray:
    found = measured.copy()
    seen = np.isfinite(found[:, 0])
    found[seen, 0] = error.true(found[seen, 0])
    return found
