"""A link between master and slave that delays, jitters, loses, repeats and reorders; seeded, without a clock.

Each channel has its own sequence of random numbers, so that what happens to packet k of a channel depends on
the seed alone. A packet is lost with the probability `loss`, in bursts of `burst` packets on average (a
two-state Gilbert model). What is not lost arrives after delay + jitter x u, u uniform in -1..1; packets keep
their order all the same, as in a queue, except that `reorder` of them are overtaken: they arrive
`overtaken_by` later, out of order. `duplicate` of them arrive twice.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from haptic_teleop_control.quantities import check_quantities, quantity


@dataclass(frozen=True)
class LinkSettings:
    """Both directions alike. Raises ConfigurationError naming the field for a value outside its range."""

    delay: float = quantity(0.0, "s", "of every packet, one way", minimum=0.0, maximum=2.0)
    jitter: float = quantity(0.0, "s", "largest deviation from the delay", minimum=0.0, maximum=1.0)
    loss: float = quantity(0.0, "", "share of the packets that are lost", minimum=0.0, maximum=0.95)
    burst: float = quantity(1.0, "", "packets lost in a row, on average", minimum=1.0, maximum=1000.0)
    reorder: float = quantity(0.0, "", "share of the packets that are overtaken", minimum=0.0, maximum=0.5)
    overtaken_by: float = quantity(
        0.004, "s", "time by which an overtaken packet is late", above=0.0, maximum=1.0
    )
    duplicate: float = quantity(0.0, "", "share of the packets that arrive twice", minimum=0.0, maximum=0.5)
    seed: int = quantity(1, "", "of all that is random", minimum=0)

    def __post_init__(self) -> None:
        check_quantities(self)


class LinkChannel:
    """One direction. sent, lost, repeated: packets so far."""

    def __init__(self, settings: LinkSettings, channel: int) -> None:
        self.settings = settings
        self._random = np.random.default_rng([settings.seed, channel])
        self._losing = False
        self._latest = -math.inf
        self.sent = self.lost = self.repeated = 0

    def transmit(self, now: float) -> list[float]:
        """Times, s, at which the packet sent at `now` arrives: none when it is lost, two when repeated.

        To be called in order of `now`.
        """
        s = self.settings
        draws = self._random.random(4)  # always as many, so that one option does not shift another's luck
        self.sent += 1
        if self._lost(float(draws[0])):
            self.lost += 1
            return []
        arrival = now + max(0.0, s.delay + s.jitter * (2.0 * float(draws[1]) - 1.0))
        if draws[2] < s.reorder:
            arrivals = [max(arrival, self._latest) + s.overtaken_by]
        else:
            self._latest = max(arrival, self._latest)
            arrivals = [self._latest]
        if draws[3] < s.duplicate:
            self.repeated += 1
            arrivals.append(arrivals[0] + s.overtaken_by)
        return arrivals

    def _lost(self, draw: float) -> bool:
        s = self.settings
        if s.loss <= 0.0:
            return False
        # Mean length of a burst 1/leave; share of time in it loss = enter / (enter + leave).
        leave = 1.0 / s.burst
        enter = leave * s.loss / (1.0 - s.loss)
        self._losing = draw >= leave if self._losing else draw < enter
        return self._losing
