"""Does the input answer to the motion? By what of it only the innovations of this sample and those before
explain (Granger causality, Econometrica 37, 1969): a controller's output has the noise of its readings in it,
and what disturbs the joint a moment later. No signal that was made before does."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import FAILURES, channels, innovations
from haptic_teleop_sysid.estimation.records import Record

FloatArray = NDArray[np.float64]

#: Samples of the input's own past that predict it, and of the innovations.
_OWN, _INNOVATIONS = 12, 6
#: Median errors beyond which a reference jumps; such samples are left out.
_JUMPS = 5.0
#: Share of what the past does not predict that innovations must explain: all of 46 recordings of the
#: benchmark's closed loops have more than 0.32, none of 232 in an open loop more than 0.18.
ANSWERS = 0.25
_SAME = 1e-10


def answers(record: Record, innovation: FloatArray) -> bool:
    """Whether the input of a recording is a controller's, by its innovations (n, channels)."""
    return answered_share(record, innovation) > ANSWERS


def in_open_loop(fit: Fit, records: Sequence[Record]) -> bool:
    """Whether the input of none of some recordings is a controller's; not of those too short to tell, or
    where arithmetic fails. ``fit``: of them."""
    packed = pack(fit.model)
    if not all(len(r) >= 10 * (_OWN + _INNOVATIONS) and np.any(r.input) for r in records):
        return False
    try:
        runs = [innovations(packed, fit.noise, r).innovation[:, : len(channels(packed, r))] for r in records]
    except FAILURES:
        return False
    return not any(answers(record, innovation) for record, innovation in zip(records, runs, strict=True))


def answered_share(record: Record, innovation: FloatArray) -> float:
    """Share of the mean square of the input, as far as its own past does not predict it, that innovations
    explain, 0 to 1; 0 where nothing is left to explain or the recording is too short."""
    input_, n = record.input / max(float(np.std(record.input)), 1e-300), len(record)
    if n < 10 * (_OWN + _INNOVATIONS):
        return 0.0
    size = np.std(innovation, axis=0)
    innovation = innovation[:, size > 0.0] / size[size > 0.0]
    own = np.column_stack([np.ones(n - _OWN), *(input_[_OWN - k : n - k] for k in range(1, _OWN + 1))])
    past = np.column_stack([innovation[_OWN - k : n - k] for k in range(_INNOVATIONS)])
    now = input_[_OWN:]
    kept = _after_no_jump(np.diff(input_, 2)[_OWN - 2 :])
    for _ in range(2):
        kept &= _after_no_jump(now - own @ _fitted(own[kept], now[kept]))
    own, past, now = own[kept], past[kept], now[kept]
    error = now - own @ _fitted(own, now)
    beside = past - own @ _fitted(own, past)
    left = error - beside @ _fitted(beside, error)
    power = float(error @ error)
    return 1.0 - float(left @ left) / power if power > 0.0 else 0.0


def _after_no_jump(error: FloatArray) -> NDArray[np.bool_]:
    """At which samples nothing jumps, nor did among those that predict them."""
    jumps = np.abs(error) > _JUMPS * 1.4826 * np.median(np.abs(error)) + 1e-12
    return np.convolve(jumps, np.ones(_OWN + 1))[: len(jumps)] < 0.5


def _fitted(columns: FloatArray, values: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.lstsq(columns, values, rcond=_SAME)[0], dtype=np.float64)
