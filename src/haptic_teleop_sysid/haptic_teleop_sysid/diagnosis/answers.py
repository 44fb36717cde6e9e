"""What the innovations of a fitted model answer to torques and encoder errors: a linear filter."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg import expm

from haptic_teleop_sim.effects import EffectEntry, EffectParameter
from haptic_teleop_sim.kernel import pack
from haptic_teleop_sysid.estimation.gauss_newton import Fit, whiten
from haptic_teleop_sysid.estimation.likelihood import channels, innovations
from haptic_teleop_sysid.estimation.noise import linearised, observer_gain
from haptic_teleop_sysid.estimation.records import Record

from .along_motion import columns

FloatArray = NDArray[np.float64]

#: Values that are filtered at once.
_CHUNK = 48


class Answers:
    """What the innovations of a fitted model answer to torques and encoder errors."""

    def __init__(self, fit: Fit, records: Sequence[Record]):
        self.packed = pack(fit.model)
        self.fit, self.records = fit, records
        self.runs, whitened, slopes = [], [], []
        for record in records:
            run = innovations(self.packed, fit.noise, record, fit.free)
            e, j = whiten(self.packed, record, run.innovation, run.d_innovation)
            self.runs.append(run)
            whitened.append(e)
            slopes.append(j)
        jacobian = np.concatenate(slopes)
        scale = np.sqrt(np.sum(jacobian**2, axis=0))
        self.structure = np.linalg.qr(jacobian[:, scale > 0.0] / scale[scale > 0.0])[0]
        self.left = np.concatenate(whitened)
        self.left = self.left - self.structure @ (self.structure.T @ self.left)
        self.systems = [self._system(record) for record in records]

    def _system(self, record: Record) -> tuple[FloatArray, FloatArray]:
        a, _ = linearised(self.packed, self.fit.noise.reference)
        transition = np.asarray(expm(a * record.dt), dtype=np.float64)
        transition[4, 4], transition[5, 5] = self.fit.noise.decay(record.dt)
        gain = observer_gain(self.packed, self.fit.noise, record.dt, channels(self.packed, record))
        return transition, np.ascontiguousarray(gain[[0, 1, 2, 3, -2, -1]])

    def gains(
        self, entry: EffectEntry, parameter: EffectParameter, place: str, values: Sequence[float]
    ) -> FloatArray:
        """Nats (values,) that the effect promises at each value of its scanned parameter."""
        found = np.zeros(len(values))
        channel = 1 if place.startswith("arm") else 0
        for begin in range(0, len(values), _CHUNK):
            some = values[begin : begin + _CHUNK]
            parts = []
            for record, run, (transition, gain) in zip(self.records, self.runs, self.systems, strict=True):
                torques = [columns(entry, parameter, v, record, run.states, channel) for v in some]
                answers = answers_to(
                    np.ascontiguousarray(np.concatenate(torques).T),
                    channel,
                    entry.kind == "output",
                    np.isfinite(record.measured),
                    transition,
                    gain,
                )
                parts.append(whiten(self.packed, record, run.innovation, answers)[1])
            stacked = np.concatenate(parts)
            stacked -= self.structure @ (self.structure.T @ stacked)
            scores, each = stacked.T @ self.left, stacked.shape[1] // len(some)
            for i in range(len(some)):
                own = slice(i * each, (i + 1) * each)
                matrix, score = stacked[:, own].T @ stacked[:, own], scores[own]
                size = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
                solved = np.linalg.lstsq(matrix / np.outer(size, size), score / size, rcond=1e-9)[0]
                found[begin + i] = 0.5 * float(solved @ (score / size))
        return found


@njit(cache=True, error_model="numpy")
def answers_to(
    columns: FloatArray,
    channel: int,
    output: bool,
    read: NDArray[np.bool_],
    transition: FloatArray,
    gain: FloatArray,
) -> FloatArray:
    """Innovations (n, 2, columns) that answer each torque (n, columns) at motor (0) or arm (1), held over a
    sample, or each error of that encoder; ``read`` (n, 2): which readings there are."""
    n, m = columns.shape
    answers = np.zeros((n, 2, m))
    x = np.zeros((6, m))
    t, g = transition, gain
    # Column by column in scalars, which compilers turn into vectors over the columns.
    torque, error = 0.0 if output else 1.0, 1.0 if output else 0.0
    b = torque * transition[:, 4 + channel]
    w0, w1 = error * (1.0 - channel), error * channel
    for k in range(n):
        r0, r1 = 1.0 if read[k, 0] else 0.0, 1.0 if read[k, 1] else 0.0
        for c in range(m):
            f = columns[k, c]
            e0, e1 = r0 * (x[0, c] + w0 * f), r1 * (x[1, c] + w1 * f)
            answers[k, 0, c], answers[k, 1, c] = e0, e1
            y0 = x[0, c] - g[0, 0] * e0 - g[0, 1] * e1
            y1 = x[1, c] - g[1, 0] * e0 - g[1, 1] * e1
            y2 = x[2, c] - g[2, 0] * e0 - g[2, 1] * e1
            y3 = x[3, c] - g[3, 0] * e0 - g[3, 1] * e1
            y4 = x[4, c] - g[4, 0] * e0 - g[4, 1] * e1
            y5 = x[5, c] - g[5, 0] * e0 - g[5, 1] * e1
            x[0, c] = (
                t[0, 0] * y0
                + t[0, 1] * y1
                + t[0, 2] * y2
                + t[0, 3] * y3
                + t[0, 4] * y4
                + t[0, 5] * y5
                + b[0] * f
            )
            x[1, c] = (
                t[1, 0] * y0
                + t[1, 1] * y1
                + t[1, 2] * y2
                + t[1, 3] * y3
                + t[1, 4] * y4
                + t[1, 5] * y5
                + b[1] * f
            )
            x[2, c] = (
                t[2, 0] * y0
                + t[2, 1] * y1
                + t[2, 2] * y2
                + t[2, 3] * y3
                + t[2, 4] * y4
                + t[2, 5] * y5
                + b[2] * f
            )
            x[3, c] = (
                t[3, 0] * y0
                + t[3, 1] * y1
                + t[3, 2] * y2
                + t[3, 3] * y3
                + t[3, 4] * y4
                + t[3, 5] * y5
                + b[3] * f
            )
            x[4, c] = t[4, 4] * y4
            x[5, c] = t[5, 5] * y5
    return answers
