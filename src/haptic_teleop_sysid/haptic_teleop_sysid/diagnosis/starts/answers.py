"""What the innovations of a fitted model answer to torques and encoder errors: a linear filter."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.compiled import njit
from haptic_teleop_sim.effects import EffectEntry, EffectParameter
from haptic_teleop_sim.kernel import pack
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import FAILURES, channels, innovations
from haptic_teleop_sysid.estimation.noise import observer
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.whitening import whiten

from ..hypotheses.along_motion import columns, variables_along

FloatArray = NDArray[np.float64]

#: Values that are filtered at once, and samples times values (some 80 bytes each).
_CHUNK, _MOST_AT_ONCE = 48, 10_000_000

#: Share of an answer's square beyond which the structure's parameters leave nothing that rounding does not.
_ALL_EXPLAINED = 1e-10
#: The square that stands for it then: so large that the answer promises nothing.
_NOTHING_LEFT = 1e300


class Answers:
    """What the innovations of a fitted model answer to torques and encoder errors."""

    def __init__(self, fit: Fit, records: Sequence[Record]):
        self.packed = pack(fit.model)
        self.records = records
        self.runs, whitened, slopes = [], [], []
        for record in records:
            run = innovations(self.packed, fit.noise, record, fit.free)
            e, j = whiten(self.packed, record, run.innovation, run.d_innovation)
            self.runs.append(run)
            whitened.append(e)
            slopes.append(j)
        jacobian = np.concatenate(slopes)
        scale = np.sqrt(np.sum(jacobian**2, axis=0))
        self.motions = [
            [
                variables_along(record, run.states, channel)
                for record, run in zip(self.records, self.runs, strict=True)
            ]
            for channel in (0, 1)
        ]
        self.structure = np.linalg.qr(jacobian[:, scale > 0.0] / scale[scale > 0.0])[0]
        self.left = np.concatenate(whitened)
        self.left = self.left - self.structure @ (self.structure.T @ self.left)
        self.observers = [
            observer(self.packed, fit.noise, record.dt, channels(self.packed, record)) for record in records
        ]

    def gains(
        self, entry: EffectEntry, parameter: EffectParameter, place: str, values: Sequence[float]
    ) -> FloatArray:
        """Nats (values,) that the effect promises at each value of its scanned parameter; none at one at
        which the arithmetic fails."""
        found = np.zeros(len(values))
        channel = 1 if place.startswith("arm") else 0
        chunk = max(1, min(_CHUNK, _MOST_AT_ONCE // sum(len(r) for r in self.records)))
        for begin in range(0, len(values), chunk):
            some = values[begin : begin + chunk]
            try:
                found[begin : begin + len(some)] = self._gains(entry, parameter, some, channel)
            except FAILURES:
                for number, value in enumerate(some, start=begin):
                    with suppress(*FAILURES):
                        found[number] = self._gains(entry, parameter, [value], channel)[0]
        return found

    def _gains(
        self, entry: EffectEntry, parameter: EffectParameter, values: Sequence[float], channel: int
    ) -> FloatArray:
        return self._promised(self._answers_of(entry, parameter, values, channel), len(values))

    def _answers_of(
        self, entry: EffectEntry, parameter: EffectParameter, values: Sequence[float], channel: int
    ) -> list[FloatArray]:
        """Whitened answers, an array (samples, columns) a recording, columns by value."""
        parts = []
        for record, run, motion, (transition, gain, shown) in zip(
            self.records, self.runs, self.motions[channel], self.observers, strict=True
        ):
            torques = [columns(entry, parameter, v, motion) for v in values]
            answers = answers_to(
                np.ascontiguousarray(np.concatenate(torques).T),
                channel,
                entry.kind == "output",
                record.read,
                transition,
                gain,
                shown,
            )
            parts.append(whiten(self.packed, record, run.innovation, answers)[1])
        return parts

    def _promised(self, parts: Sequence[FloatArray], number: int) -> FloatArray:
        """Nats (number,) of whitened answers, an array (samples, columns) a recording, columns by value."""
        stacked = np.concatenate(parts) if len(parts) > 1 else parts[0]
        each = stacked.shape[1] // number
        scores = (stacked.T @ self.left).reshape(number, each)
        # What the structure's parameters explain goes from the products, not from every answer.
        explained = (self.structure.T @ stacked).reshape(-1, number, each)
        values = stacked.reshape(-1, number, each)
        matrix = np.empty((number, each, each))
        for i in range(each):
            for j in range(i, each):
                whole = np.einsum("nk,nk->k", values[:, :, i], values[:, :, j])
                rest = whole - np.einsum("nk,nk->k", explained[:, :, i], explained[:, :, j])
                if i == j:
                    rest = np.where(rest > _ALL_EXPLAINED * whole, rest, _NOTHING_LEFT)
                matrix[:, i, j] = matrix[:, j, i] = rest
        size = np.sqrt(np.diagonal(matrix, axis1=1, axis2=2))
        scaled, own = scores / size, matrix / (size[:, :, None] * size[:, None, :])
        inverse = np.linalg.pinv(own, rcond=1e-9, hermitian=True)
        return 0.5 * np.einsum("ki,kij,kj->k", scaled, inverse, scaled)


@njit(cache=True, error_model="numpy", nogil=True)
def answers_to(
    pushes: FloatArray,
    channel: int,
    output: bool,
    read: NDArray[np.bool_],
    transition: FloatArray,
    gain: FloatArray,
    shown: FloatArray,
) -> FloatArray:
    """Innovations (n, 2, columns) that answer each torque (n, columns) at motor (0) or arm (1), held over a
    sample, or each error of that encoder; ``read`` (n, 2): which readings there are."""
    n, m = pushes.shape
    answers = np.zeros((n, 2, m))
    x, corrected = np.zeros((6, m)), np.zeros((6, m))
    for k in range(n):
        # Column by column innermost, which compilers turn into vectors over the columns.
        for ch in range(2):
            if read[k, ch]:
                error = 1.0 if output and ch == channel else 0.0
                for c in range(m):
                    answers[k, ch, c] = x[ch, c] + error * pushes[k, c]
                if shown[ch, 2 + ch] != 0.0:
                    # A reading that is late by part of a sample shows something of all the rest.
                    for c in range(m):
                        answers[k, ch, c] -= x[ch, c]
                        for j in range(6):
                            answers[k, ch, c] += shown[ch, j] * x[j, c]
        for i in range(6):
            for c in range(m):
                corrected[i, c] = x[i, c] - gain[i, 0] * answers[k, 0, c] - gain[i, 1] * answers[k, 1, c]
        for i in range(6):
            # The disturbances themselves (the last two states) do not answer.
            torque = 0.0 if output or i >= 4 else transition[i, 4 + channel]
            for c in range(m):
                x[i, c] = torque * pushes[k, c]
            for j in range(6):
                factor = transition[i, j]
                if factor != 0.0:
                    for c in range(m):
                        x[i, c] += factor * corrected[j, c]
    return answers
