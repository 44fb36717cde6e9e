"""A model for what has no name: the free curve that explains most, as a `torque_map`.

Each torque over one or two quantities of the motion (`inverse_dynamics.latent`) is drawn by least squares on
the estimation recordings; the structure's parameters are then fitted beside it, and the free simulation of
all recordings says what it is worth. What is chosen among them stays if validation recordings are simulated
better: what has memory, or acts at moments, gives a curve on one recording that does not hold on another.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.effects import MEASURED
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import FAILURES
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.whole_fit import fit_whole

from ..inputs.scales import within_reach
from .drawn_map import drawn, explained_there
from .inverse_dynamics.band import motion_band
from .inverse_dynamics.groups import Search
from .inverse_dynamics.latent import IN_A_TURN, Latent
from .places_of_maps import places_of
from .reading_error import ReadingError
from .second_method import Errors
from .suggested_law.entry_file import law_content
from .suggested_law.of_map import law_of
from .suggested_law.regression import Law

FloatArray = NDArray[np.float64]

#: Maps drawn with one search that are tried in free simulation, those that explain most torque where it was
#: not fitted.
MOST_TRIED = 3
#: Share of the simulated error on validation recordings that a map must take away to be put in.
A_GOOD_PART = 0.25
#: Share of the torque that is missing at its place (mean square, the noise of its equation included) that a
#: map must explain where it was not drawn from: a joint that creeps leaves 80 % of it to any map.
A_GOOD_TORQUE = 0.4
_ELSE = (
    "what is missing has memory, acts at moments, or follows something else: quantities that no map has "
    "together, or what was not recorded"
)
#: Factor over what a map explains from which a torque with memory, or over time, is what it is instead.
_RATHER = 1.5
#: Share of the log-likelihood that the best map gains, and of the torque that it explains where it was not
#: drawn from, with which another one is as good.
_AS_LIKELY, _AS_GOOD = 0.8, 0.9
_STEPS = 15


class _Tried(NamedTuple):
    """A map in a model: errors ``left`` of its free runs on estimation and on validation recordings, the
    ``latent`` that was drawn with a ``search``, its ``effect`` and the ``fit`` with it."""

    left: tuple[float, float]
    search: Search
    latent: Latent
    effect: Effect
    fit: Fit


@dataclass(frozen=True)
class MeasuredMap:
    """What became of the attempt: ``effect`` and the ``fit`` of the model with it, both None where none is
    put in; ``why``: in words; ``explained``: share of the torque that is missing that the best map explains
    where it was not fitted; ``closed``: share of the simulated error on validation recordings that it takes
    away, None where none was simulated; ``quantities``: what it depends on; ``law``: what it may be;
    ``map_share``: share of all equations that the map explains, as `Law.explained` has it."""

    why: str
    effect: Effect | None = None
    fit: Fit | None = None
    explained: float | None = None
    closed: float | None = None
    quantities: tuple[str, ...] = ()
    law: Law | None = None
    map_share: float = 1.0

    def content(self) -> dict[str, Any]:
        """For the result file."""
        found: dict[str, Any] = {"what": self.why, "added": self.effect is not None}
        for name in ("explained", "closed"):
            value = getattr(self, name)
            found[name] = None if value is None else round(float(value), 3)
        if self.effect is not None and self.effect.table is not None:
            found |= {"effect": self.effect.effect, "location": self.effect.location}
            found |= {"depends_on": list(self.quantities), "parameters": self.effect.table.to_mapping()}
            law = self.law
            found["law"] = None if law is None else law_content(law, self.effect.table, self.map_share)
        return found


def no_torque(encoder: str, error: ReadingError | None = None) -> MeasuredMap:
    """None is drawn, because what is missing is in the readings of an encoder; ``error``: these over the
    angle, where that is known."""
    if error is None:
        return MeasuredMap(
            f"no map was added: what is missing is an error of {encoder}, and no torque; see what it "
            "follows, and check how the sensor is mounted, read and stamped"
        )
    return MeasuredMap(
        f"no map was added: what is missing is an error of {encoder}, and no torque; over the angle it is up "
        f"to {error.largest:.2g} rad, so check how the sensor is mounted and read, or calibrate it"
    )


def measured_map(
    base: Fit,
    given: Model,
    estimation: Sequence[Record],
    validation: Sequence[Record],
    errors: Errors,
    say: Callable[[str], None] = lambda text: None,
    cutoff: float | None = None,
    resized: Callable[[Fit], Fit | None] = lambda fit: None,
    least: float = A_GOOD_TORQUE,
) -> MeasuredMap:
    """The map that explains most of what ``base``, fitted from ``given``, lacks; ``cutoff``: Hz, of the band
    of the motion, by default that of these recordings; ``resized``: a fit with the parameters that free runs
    want, which is taken where it errs no more on both kinds of recordings; ``least``: share of the torque
    that is missing which it must explain to be tried in free simulation; see the module."""
    if any(e.entry.tabulated for e in base.model.effects):
        return MeasuredMap(f"the given model has a {MEASURED.name} already")
    cutoff = motion_band([*estimation, *validation]) if cutoff is None else cutoff
    try:
        places = places_of(base, given, estimation, validation, cutoff)
        drawn_over = [(one.search, latent) for one in places for latent in one.maps]
        shares = {latent: explained_there(search, latent) for search, latent in drawn_over}
    except FAILURES:
        return MeasuredMap("the inverse dynamics of these recordings cannot be computed")
    if not drawn_over:
        return MeasuredMap("the recordings move too little to draw a torque over anything")
    nearest = max(shares, key=lambda latent: shares[latent])
    most = shares[nearest]
    share = max(search.explained((latent,)) for search, latent in drawn_over)
    others = [(one.search.explained((one.other,)), one.other) for one in places if one.other is not None]
    told, other = max(others, key=lambda pair: pair[0], default=(-math.inf, None))
    if other is not None and told > max(_RATHER * share, 0.0):
        why = f"no map was added: what is missing follows the {_named(other)}, which is no map's to follow"
        return MeasuredMap(why, explained=most)
    if most < least:
        why = (
            f"no map was added: the best one, over {_named(nearest)}, explains {100 * max(most, 0.0):.0f} % "
            f"of the torque that is missing there where it was not drawn from; {_ELSE}"
        )
        return MeasuredMap(why, explained=most, quantities=_told(nearest))
    before, tried = errors(base.model), list[_Tried]()
    for search, one in (pair for place in places for pair in place.best(MOST_TRIED)):
        if shares[one] < least:
            continue
        say(f"drawing a torque over {_named(one)}")
        effect = drawn(search, one)
        fit = _fitted(base, effect, given, estimation)
        if fit is not None and all(map(math.isfinite, left := errors(fit.model))):
            tried.append(_Tried(left, search, one, effect, fit))
    if not tried:
        return MeasuredMap("no map was added: no model with one predicts the recordings", explained=most)
    left, search, one, effect, fit = _chosen([t for t in tried if t.left[0] < before[0]] or tried, base)
    freely = resized(fit)
    after = left if freely is None else errors(freely.model)
    if freely is not None and after[0] <= left[0] and after[1] <= left[1]:
        left, fit = after, freely
    closed = 1.0 - left[1] / max(before[1], 1e-300)
    if closed < A_GOOD_PART or left[0] > before[0]:
        change = f"takes {100 * closed:.0f} % off" if closed > -0.005 else f"adds {-100 * closed:.0f} % to"
        why = (
            f"no map was added: the best one, over {_named(one)}, {change} the simulated error of recordings "
            f"that it was not drawn from; {_ELSE}"
        )
        return MeasuredMap(why, None, None, shares[one], closed, _told(one))
    why = (
        f"augmented_model.yaml has a {MEASURED.name} at {effect.location} over {_named(one)}, which takes "
        f"{100 * closed:.0f} % off the simulated error of recordings that it was not drawn from"
    )
    say("looking for a law of that torque")
    law, share = law_of(search, one, effect), search.explained((one,))
    return MeasuredMap(why, effect, fit, shares[one], closed, _told(one), law, share)


def _fitted(base: Fit, effect: Effect, given: Model, records: Sequence[Record]) -> Fit | None:
    """The structure's parameters and noise levels beside a map, from what was fitted and from what was
    believed: the better end."""
    ends, limits = [], within_reach(given)
    for start in (base.model, replace(given, effects=base.model.effects, fixed=base.model.fixed)):
        try:
            model = start.with_effects(effect)
            ends.append(fit_whole(model, base.noise, records, iterations=_STEPS, limits=limits))
        except FAILURES:
            continue
    good = [f for f in ends if np.isfinite(f.log_likelihood)]
    return max(good, key=lambda f: f.log_likelihood, default=None)


def _chosen(tried: Sequence[_Tried], base: Fit) -> _Tried:
    """Of the maps that predict the estimation recordings nearly as well as the best one, those of its search
    that explain nearly as much torque where they were not drawn from: of these a curve before a surface,
    then the one that explains most. They were drawn from the torques: the likelihood has not seen them yet,
    and compares what two searches, of which each leaves something else unexplained, do not. But it has not
    seen angles to which the estimation recordings did not go, either."""

    def gained(one: _Tried) -> float:
        return one.fit.log_likelihood - base.log_likelihood

    best = max(tried, key=gained)
    enough = min(_AS_LIKELY * gained(best), gained(best))
    likely = [t for t in tried if t.search is best.search and gained(t) >= enough]
    explained = [t.search.explained((t.latent,)) for t in likely]
    most = min(_AS_GOOD * max(explained), max(explained))
    good = [(t, share) for t, share in zip(likely, explained, strict=True) if share >= most]
    return min(good, key=lambda pair: (len(pair[0].latent.quantities), -pair[1]))[0]


def _named(latent: Latent) -> str:
    return " and ".join(latent.quantities)


def _told(latent: Latent) -> tuple[str, ...]:
    """The quantities, of which a map has all turns."""
    return tuple(name.removesuffix(IN_A_TURN) for name in latent.quantities)
