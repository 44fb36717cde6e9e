"""Errors of free runs over stretches of several lengths.

A free run of some seconds adds up every small error of the torque: a joint that friction holds a moment too
long stays behind for good, and a right model then errs more than one without friction, which never stays.
Over a period of the fastest motion the same recordings show which torque acts; such short stretches alone
would not show what acts slowly. So a model is judged by the geometric mean over the windows of `proof.Course`
and over stretches of some periods.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.simulation.windows import SHORTEST, cut

from .proof import Course

#: Lengths of the shorter stretches, in periods of the upper end of the motion's band.
PERIODS = (4.0, 1.0)
#: Least factor between two lengths.
_APART = 1.5
#: Error, relative to the motion's spread, below which a free run is as good as it can be.
PERFECT = 0.002


@dataclass(frozen=True)
class Horizons:
    """``courses``: the recordings with the windows of either length, the longest first; the first ``count``
    recordings are the estimation's."""

    courses: tuple[Course, ...]
    count: int

    @staticmethod
    def of(course: Course, count: int, cutoff: float) -> Horizons:
        """The course as it is, and cut shorter so far as its samples allow; ``cutoff``: Hz, of the motion's
        band."""
        parts = zip(course.data, course.windows, strict=True)
        longest = max(d.dt * (stop - start) for d, w in parts for start, stop in w.spans)
        least = SHORTEST * max(d.dt for d in course.data)
        lengths = [longest, *(max(periods / cutoff, least) for periods in PERIODS)]
        courses = [course]
        for before, seconds in pairwise(lengths):
            if before < _APART * seconds:
                break
            try:
                windows = tuple(cut(d, seconds, "for the mean over lengths") for d in course.data)
            except ConfigurationError:
                break
            courses.append(Course(course.data, windows))
        return Horizons(tuple(courses), count)

    @property
    def shortest(self) -> Course:
        """The recordings with the shortest windows."""
        return self.courses[-1]

    def by_length(self, model: Model) -> np.ndarray:
        """Error of the free runs by length of the stretches (lengths, 2), on estimation and on validation
        recordings, as a share of the motion's spread: 1 is no better than the mean."""
        return np.array([free_errors(course, self.count, model) for course in self.courses])

    def percent(self, model: Model) -> tuple[float, float]:
        """Simulated fit, percent, on estimation and on validation recordings: the mean over the lengths."""
        estimation, validation = 100.0 * (1.0 - np.mean(self.by_length(model), axis=0))
        return float(estimation), float(validation)

    def errors(self, model: Model) -> tuple[float, float]:
        """Geometric mean of `by_length` over the lengths, each at least PERFECT."""
        mean = np.exp(np.mean(np.log(np.maximum(self.by_length(model), PERFECT)), axis=0))
        return float(mean[0]), float(mean[1])


def free_errors(course: Course, count: int, model: Model) -> tuple[float, float]:
    """Error of the model's free runs on estimation and on validation recordings, as a share of the motion's
    spread; the first ``count`` recordings of the course are the estimation's."""
    errors = 1.0 - np.array(course.percent(model)) / 100.0
    return float(np.mean(errors[:count])), float(np.mean(errors[count:]))
