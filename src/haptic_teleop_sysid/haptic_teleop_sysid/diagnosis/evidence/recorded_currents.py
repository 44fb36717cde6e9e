"""A recording's command and measured current, and what an effect of the actuator explains of the latter."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.compiled import njit
from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sim.kernel import acting_torque, pack
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.recordings.dataset import DataSet

FloatArray = NDArray[np.float64]

#: Effects that a current behind them shows, and their parameter.
SHOWN = {e.name: p.name for e in EFFECTS.values() for p in e.parameters if p.in_current}
#: Standard deviation of the sense that is granted at least, relative to the rms command.
_EXACT = 1e-4
#: Samples that speak most for an effect and do not count.
_SPIKES = 3
#: Differences of readings, relative to the largest, that are rounding.
_ROUNDING = 1e-9
#: Samples at the start that may still answer what was commanded before the recording.
UNSEEN = 64
#: Length of the liveliest stretch, samples.
_LIVELIEST = 8192


@dataclass(frozen=True)
class Currents:
    """Both currents of a recording: ``command`` (n,), zero where it is not known; ``good`` (n,): the samples
    that are judged; ``sent``, ``sensed``: command and measured current there; ``floor``: mean square, A^2,
    that is granted the sense; ``step``: least difference of its readings, A, but for rounding."""

    data: DataSet
    command: FloatArray
    good: NDArray[np.bool_]
    sent: FloatArray
    sensed: FloatArray
    floor: float
    step: float

    @classmethod
    def of(cls, data: DataSet) -> Currents:
        command, sensed = np.asarray(data.commanded_input, dtype=float), np.asarray(data.input, dtype=float)
        good = np.isfinite(command) & np.isfinite(sensed)
        command = np.where(np.isfinite(command), command, 0.0)
        # Not judged, but commanded all the same: the first judged samples answer them.
        good[: min(UNSEEN, len(good) // 10)] = False
        floor = (_EXACT * float(np.std(command[good]))) ** 2
        apart = np.diff(np.unique(sensed[good]))
        apart = apart[apart > _ROUNDING * np.max(np.abs(sensed[good]))]
        return cls(data, command, good, command[good], sensed[good], floor, float(min(apart, default=0.0)))

    @cached_property
    def liveliest(self) -> Currents:
        """The stretch of _LIVELIEST samples in which the command changes most; itself where it is shorter, or
        half of that is not judged."""
        n = len(self.command)
        if n <= _LIVELIEST:
            return self
        changes = np.cumsum(np.append(0.0, np.diff(self.command) ** 2))
        begins = np.arange(0, n - _LIVELIEST + 1, _LIVELIEST // 4)
        first = int(begins[np.argmax(changes[begins + _LIVELIEST - 1] - changes[begins])])
        stretch = slice(first, first + _LIVELIEST)
        command, good = self.command[stretch], self.good[stretch].copy()
        good[:UNSEEN] = False
        if np.mean(good) < 0.5:
            return self
        sensed = np.zeros(n)
        sensed[self.good] = self.sensed
        return replace(self, command=command, good=good, sent=command[good], sensed=sensed[stretch][good])


def nats_of(model: Model, effect: Effect, currents: Currents) -> float:
    """Nats by which the measured current follows the effect's better than the command."""
    command, data = currents.command, currents.data
    if effect.entry.kind == "skew":
        at = np.arange(len(command)) - effect.parameters[SHOWN[effect.effect]] / data.dt
        expected = np.interp(at, np.arange(len(command)), command)
    else:
        packed = pack(model.with_effects(effect))
        expected = acting_torque(packed, command, data.dt, data.start) / packed.torque_constant
    before, after = _errors(currents.sent, expected[currents.good], currents.sensed, _SPIKES)
    floor = currents.floor
    return 0.5 * len(currents.sent) * float(np.log((before + floor) / (after + floor)))


@njit(cache=True, nogil=True, error_model="numpy")
def _errors(
    command: FloatArray, expected: FloatArray, sensed: FloatArray, spikes: int
) -> tuple[float, float]:
    """Mean squares, A^2, of what is left of the measured current (n,) about offset and scale times the
    command and about those times what is expected of it.

    The samples that speak most for the latter do not count: what speaks for an effect at a few alone is a
    spike, or the command that ended the experiment."""
    n = len(sensed)
    a, b = np.empty(n), np.empty((2, n))
    means = sensed.mean(), command.mean(), expected.mean()
    for i in range(n):  # one by one: see `compiled.py`
        a[i], b[0, i], b[1, i] = sensed[i] - means[0], command[i] - means[1], expected[i] - means[2]
    slopes = np.zeros(2)
    for k in range(2):
        power = b[k] @ b[k]
        slopes[k] = (b[k] @ a) / power if power > 0.0 else 0.0
    # Largest differences of the squares, in rising order, and where they are.
    most, where = np.full(spikes, -np.inf), np.zeros(spikes, dtype=np.int64)
    for i in range(n):
        gain = (a[i] - slopes[0] * b[0, i]) ** 2 - (a[i] - slopes[1] * b[1, i]) ** 2
        if gain > most[0]:
            j = 0
            while j + 1 < spikes and gain > most[j + 1]:
                most[j], where[j] = most[j + 1], where[j + 1]
                j += 1
            most[j], where[j] = gain, i
    left = np.empty(2)
    for k in range(2):
        own, cross, both, mean_a, mean_b = a @ a, a @ b[k], b[k] @ b[k], 0.0, 0.0
        for j in range(spikes):
            x, y = a[where[j]], b[k, where[j]]
            own, cross, both, mean_a, mean_b = (
                own - x * x,
                cross - x * y,
                both - y * y,
                mean_a - x,
                mean_b - y,
            )
        count = n - spikes
        own, cross, both = own - mean_a**2 / count, cross - mean_a * mean_b / count, both - mean_b**2 / count
        left[k] = max(own - cross**2 / both, 0.0) / count if both > 0.0 else own / count
    return left[0], left[1]
