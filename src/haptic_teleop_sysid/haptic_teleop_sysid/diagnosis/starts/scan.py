"""A fine search along the one parameter that fits cannot climb: an order, a natural frequency, an angle.

A ripple of order 105 gains nothing at order 104 or 106, so starts must lie denser than a linearisation of the
full model affords.  Along the recorded motion an effect is a torque (or an error of an encoder) that is known
but for its size, and the observer's innovations answer it as a linear filter: one run of that filter per
value gives the best size and what it gains (score test; the structure's parameters are projected out).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.effects import EFFECTS, EffectEntry, EffectParameter, locations
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import FAILURES
from haptic_teleop_sysid.estimation.parallel import side_by_side
from haptic_teleop_sysid.estimation.records import Record, thinned_to

from ..hypotheses.candidates import Scanned
from ..inputs.scales import Scales, highest_order
from .answers import Answers

FloatArray = NDArray[np.float64]

#: Most values of one parameter, and how many of the best are starts.
_MOST_VALUES, _BEST = 160, 3
#: Highest whole number of cycles per revolution that is tried on a joint that turns on and on.
_MOST_CYCLES = 200
#: How far before the furthest angles a stop is tried, in shares of half the travel, and the least share that
#: an end lies beyond zero: the sign of a stop's angle is its side.
_BEFORE = (0.002, 0.01, 0.02, 0.04, 0.06, 0.09, 0.12, 0.16, 0.2, 0.25, 0.3)
_BEYOND = 0.02
#: Ratio of neighbouring natural frequencies; a lightly damped part answers some 4 % to either side.
_RATIO = 1.04
#: Places of an angle within the travel.
_PLACES = 24


def scan(fit: Fit, records: Sequence[Record], scales: Scales) -> Scanned:
    """The most promising values of every scanned parameter, by effect and place; none where the arithmetic
    fails."""
    # Of hundreds of orders three become starts.
    thin = thinned_to(records)
    try:
        fine = Answers(fit, records)
        quick = fine if thin is records else Answers(fit, thin)
    except FAILURES:
        return {}
    most = [np.inf if thin is records else highest_order(thin, channel) for channel in (0, 1)]
    sought: list[tuple[EffectEntry, EffectParameter, str]] = []
    for name, entry in EFFECTS.items():
        parameter = next((p for p in entry.parameters if p.scan), None)
        if parameter is not None and parameter.scan != "delay":  # see `inverse_dynamics.late_channels`
            sought += [(entry, parameter, place) for place in locations(name, fit.model.structure)]

    def best(one: tuple[EffectEntry, EffectParameter, str]) -> list[float]:
        entry, parameter, place = one
        values = list(scanned_values(parameter, scales, place))
        few = sum(v < most[place.startswith("arm")] for v in values) if parameter.scan == "order" else 0
        gains = [
            quick.gains(entry, parameter, place, values[:few]),
            fine.gains(entry, parameter, place, values[few:]),
        ]
        return _peaks(values, np.concatenate(gains))

    starts = side_by_side(best, sought)
    return {
        (entry.name, fit.model.location(place)): values
        for (entry, _, place), values in zip(sought, starts, strict=True)
    }


def both(one: Scanned, other: Scanned) -> Scanned:
    """The values of both, without repetition, those of ``one`` first."""
    return {key: list(dict.fromkeys([*values, *other.get(key, [])])) for key, values in one.items()}


def scanned_values(parameter: EffectParameter, scales: Scales, place: str) -> Iterator[float]:
    """All values at which a scanned parameter of an effect at ``place`` is tried."""
    channel = 1 if place.startswith("arm") else 0
    if parameter.scan == "order":
        span = max(scales.span(channel), 1e-6)
        # A sine of which less than a quarter was seen is a slope; neighbours differ by a quarter of a cycle.
        first, step = math.pi / 2 / span, math.pi / 2 / span
        for i in range(_MOST_VALUES):
            if parameter.minimum <= first + i * step <= parameter.maximum:
                yield first + i * step
        if span > 2.0 * math.pi:
            # What turns on and on repeats with its revolution.
            last = min(scales.orders[channel], _MOST_CYCLES, parameter.maximum)
            yield from map(float, range(math.floor(_MOST_VALUES * step) + 1, math.floor(last) + 1))
    elif parameter.scan == "frequency":
        value, last = 0.5, min(0.3 / scales.dt, parameter.maximum)
        while value < last:
            yield value
            value *= _RATIO
    elif parameter.scan == "within":
        for i in range(1, _PLACES):
            yield scales.lowest[channel] + scales.span(channel) * i / _PLACES
    else:
        half = 0.5 * scales.span(channel)
        for side, end in ((1.0, scales.highest[channel]), (-1.0, scales.lowest[channel])):
            if side * end > _BEYOND * half:
                angles = (end - side * share * half for share in _BEFORE)
                yield from (angle for angle in angles if side * angle > 0.0)


def _peaks(values: Sequence[float], gains: FloatArray) -> list[float]:
    """Values at local maxima of the gain, best first."""
    order = [
        i
        for i in np.argsort(-gains)
        if gains[i] > 0.0 and gains[i] >= max(gains[max(i - 1, 0)], gains[min(i + 1, len(gains) - 1)])
    ]
    return [values[i] for i in order[:_BEST]]
