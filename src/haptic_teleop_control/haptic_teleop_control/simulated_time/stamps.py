"""Stamps of simulated samples; the same in the graph and in lockstep, to the nanosecond."""

from __future__ import annotations

import math

ORIGIN = 1_000_000_000
"""ns, stamp of time zero: not 0, which readers of ROS messages take for "no stamp"."""

LAST_WORD = 1
"""ns after the last state: the stamp of a zero command that answers no state, because nobody grants time any
more."""


def sample_stamp(k: int, rate: float) -> int:
    """ns, stamp of sample k >= 0 of what is sampled at `rate` Hz > 0: ORIGIN + k / rate, rounded."""
    return ORIGIN + round(k / rate * 1e9)


def sample_count(rate: float, duration: float) -> int:
    """Samples at 0, 1/rate, ... up to, not including, `duration` s."""
    return math.ceil(duration * rate - 1e-9)


def seconds(stamp: int) -> float:
    """s since time zero."""
    return (stamp - ORIGIN) * 1e-9
