"""How far ahead a free run says anything: of an unstable joint the smallest error grows until it is all that
is seen.

A quadcopter on its rig or a pendulum held upright is kept where it is by its controller. A model of it that
is right runs away in a free run, by an error of its start, and one that lacks the torque that makes it
unstable does not: the wrong one simulates such a recording better. Where friction and a load carry nearly
all of the torque, the little that is left of it moves the joint, and a right model drifts away, too. Over
stretches in which errors do not grow yet, both can be compared.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.kernel import Packed, acting_torque, pack, respond
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.recordings.dataset import DataSet
from haptic_teleop_sysid.simulation.fit import Spans
from haptic_teleop_sysid.simulation.initial_state import measured_state, without_actuator

from .horizons import free_errors
from .inverse_dynamics.searched_groups import Group
from .proof import Course

#: Factor over what an error of the first velocity would be, if nothing acted on it, from which it has grown
#: too far: sinh(x) / x = 5 at x = 3.6 time constants of the unstable mode.
GROWN = 5.0
#: Error of the first velocity, as a share of its rms.
PUSHED = 1e-4
#: Share of the missing torque, on recordings that were not fitted, from which a free run that is no better
#: than the mean says nothing against the names. By hand: of 85 recordings of 48 simulated joints and 37 real
#: axes it holds for two, slow axes of one robot, moved alone.
TORQUES_SAY_ALL = 0.95
#: Error of free runs, as a share of the motion's spread, with which they follow it.
FOLLOWED = 0.5


def while_predictable(course: Course, model: Model) -> Course:
    """The course, in windows that are no longer than an error takes to grow by GROWN in free runs of
    ``model`` (see `predictable`); as it is where none does, or where a window would hold too few samples."""
    seconds = predictable(course, model)
    if not math.isfinite(seconds):
        return course
    why = f"because errors of a simulation grow {GROWN:g} times in {seconds:.2g} s: the joint is unstable"
    return course.no_longer_than(seconds, why)


def while_followed(course: Course, count: int, group: Group, cutoff: float) -> Course:
    """The course, in windows so short that free runs of a ``group`` follow the motion, where those are no
    better than the mean although the group explains TORQUES_SAY_ALL of the torques; as it is elsewhere, and
    where no window of half a period of the band (``cutoff``, Hz) or more does. The first ``count`` recordings
    are the estimation's."""
    coarse = course.coarse(cutoff) if group.explained >= TORQUES_SAY_ALL else None
    if coarse is None or max(free_errors(coarse, count, group.model)) < 1.0:
        return course
    spans = [(d.dt, span) for d, w in zip(course.data, course.windows, strict=True) for span in w.spans]
    seconds = 0.5 * max(dt * (stop - start) for dt, (start, stop) in spans)
    while seconds * cutoff >= 0.5:
        why = (
            f"because in longer ones the {100 * (1.0 - group.explained):.2g} % of the missing torque that "
            "nothing explains decides where the joint goes"
        )
        if max(free_errors(coarse.no_longer_than(seconds, why), count, group.model)) < FOLLOWED:
            return course.no_longer_than(seconds, why)
        seconds *= 0.5
    return course


def predictable(course: Course, model: Model) -> float:
    """Seconds, in the median over the windows of a course, after which an error of the first velocity in a
    free run of ``model`` has grown by GROWN; infinite where it does not within them."""
    mechanics = pack(without_actuator(model))
    found: list[float] = []
    for data, windows in zip(course.data, course.windows, strict=True):
        torque = acting_torque(pack(model), data.input, data.dt, data.start)
        spans = windows.spans
        states = np.array([measured_state(data, start) for start, _ in spans])
        push = PUSHED * float(np.sqrt(np.mean(data.motor_velocity**2)))
        pushed = states + np.array([0.0, 0.0, push, push])
        run, other = (_angles(mechanics, data, torque, spans, one) for one in (states, pushed))
        grown = np.abs(other - run)
        for start, stop in spans:
            after = data.dt * np.arange(1, stop - start)
            with np.errstate(invalid="ignore"):
                far = np.flatnonzero(~(grown[start + 1 : stop] <= GROWN * push * after))
            found.append(float(after[far[0]]) if len(far) else math.inf)
    return float(np.median(found))


def _angles(
    mechanics: Packed,
    data: DataSet,
    torque: NDArray[np.float64],
    spans: Spans,
    states: NDArray[np.float64],
) -> NDArray[np.float64]:
    """The motor's angle (n,) in free runs over ``spans`` from ``states`` (windows, 4)."""
    return respond(
        mechanics, torque, data.dt, spans, states, exogenous=data.exogenous, t0=float(data.start)
    ).motor_position
