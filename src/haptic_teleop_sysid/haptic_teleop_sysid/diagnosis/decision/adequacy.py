"""How much of what the structure alone leaves unexplained the findings explain.

A name is better than its rivals also where all of them are wrong.  What it leaves says so: the torque that
the observer still adds with it, as a share of what it added without, and the error that a free run still
has.  Neither is ever none on a machine: up to a small share of the input and of the motion it is not counted.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import FAILURES, after_settling
from haptic_teleop_sysid.estimation.records import Record

from ..evidence.residual import left_over
from ..policy import HOLDS_BETTER, LEAST_EXPLAINED, MOST_BY_CHANCE, MOST_UNNAMED, SURE, SUREST
from .reasons import Doubt
from .search.rounds import SearchResult

#: Left-over torque, as a share of the input torque (rms), that is not worth a word.
SLIGHT_TORQUE = 0.03
#: Factor over the rms input torque from which what the observer adds is no torque: it has overflowed.
OVERFLOWS = 1e3
#: Error of a free run, as a share of the motion's spread (rms), that is not worth a word.
SLIGHT_ERROR = 0.05
#: Confidence of a name that nobody is sure of: below SURE.
NOT_SURE = SURE - 0.01
#: Share of what is missing from which the findings explain nearly all of it.
NEARLY_ALL = 0.9


class Followed(NamedTuple):
    """The quantity that most of a left-over torque follows, and the ``equation`` that lacks it."""

    equation: str
    quantity: str


@dataclass(frozen=True)
class Adequacy:
    """``torque``: share of the mean square of the torque that the observer adds to the structure alone which
    it does not add to the final model; ``free_run``: share of the mean square error of the structure's free
    run that the final model's does not have, or of the motion that this follows, where that is less;
    ``parity``: the same of what parity equations leave, see `ActingPlace.explained`; ``recovered``: of what
    any torques explain, see `torques_explained.recovered`; 0 to 1 each, 1 where nothing worth a word is left.
    ``random_left``: what is left is random as far as these recordings show, however large its share: nothing
    more could be explained; ``follows``: what most of it follows where it is not, None for nothing;
    ``worse``: the user's own model simulates the validation recordings better; ``nearly_all_torque``:
    the names do so in the band of the motion, whatever else is asked for (see `nearly_all_torque`): that only
    keeps them from being sure."""

    torque: float
    free_run: float
    random_left: bool = False
    parity: float = 1.0
    follows: Followed | None = None
    worse: bool = False
    recovered: float = 1.0
    nearly_all_torque: bool = False

    @property
    def least(self) -> float:
        """The smallest of the shares of what is missing."""
        return min(self.torque, self.free_run, self.parity)

    @property
    def surest(self) -> float:
        """The most that a name's confidence may be: the share of the size (rms, as a fit counts it) that is
        explained, 1 - sqrt(1 - least), SUREST at most. Below SURE it is the share of the mean square, and
        NOT_SURE at most: a name may be right that explains little, but none is sure. So it is where only
        chance is left: what passes for it could hide there, too; and where other torques recover clearly
        more, however little that is."""
        if self.nearly_all_torque:
            return NOT_SURE
        if self.explains_nearly_all:
            size = min(_size_of(self.least), SUREST)
            return NOT_SURE if self.follows or self.worse or not self.recovers_nearly_all else size
        return NOT_SURE if self.random_left else min(self.least, NOT_SURE)

    @property
    def explains_nearly_all(self) -> bool:
        """Whether the share of the size that is explained is enough to be sure of a name."""
        return _size_of(self.least) >= SURE

    @property
    def recovers_nearly_all(self) -> bool:
        """Whether it is the same of what any torques recover."""
        return _size_of(self.recovered) >= SURE

    @property
    def much_is_left(self) -> bool:
        """Whether so much more than chance is left that the findings are not what is missing, but beside
        it: of what the other places' equations leave, where everything acts at one place, names that are
        right take as much (HOLDS_BETTER) as tells that place. Where neither observer nor free run lacks
        anything worth a word, that is the machine's random torque, and only keeps a name from being sure."""
        if self.nearly_all_torque:
            return False
        worth_a_word = min(self.torque, self.free_run) < 1.0
        if worth_a_word and 1.0 - self.parity > 1.0 / HOLDS_BETTER**2:
            return True
        return not self.random_left and (self.follows is not None or self.least < LEAST_EXPLAINED)

    def content(self) -> dict[str, Any]:
        """What diagnosis.json says."""
        return {
            "what": "share of the mean square of the torque that the structure alone lacks, of the error of "
            "its free runs, and of what parity equations leave, that is explained; no confidence is above "
            f"the share of the size, 1 - sqrt(1 - the smallest one), nor, where that is less than {SURE:g}, "
            f"above {NOT_SURE:g}. recovered: what names of the inverse dynamics explain, as a share of what "
            f"free curves do; where 1 - sqrt(1 - recovered) is less than {SURE:g}, none is above "
            f"{NOT_SURE:g}; nor where the names explain nearly all the torque in the band of the motion, but "
            "not all that predictions of the next sample ask for",
            "torque": round(self.torque, 3),
            "free_run": round(self.free_run, 3),
            "parity": round(self.parity, 3),
            "recovered": round(self.recovered, 3),
            "left_is_random": self.random_left,
            "left_follows": None if self.follows is None else self.follows._asdict(),
            "worse_than_given": self.worse,
            "nearly_all_the_torque": self.nearly_all_torque,
            "only_worse": nothing_shown(self),
        }


def _size_of(share: float) -> float:
    """Share of the size (rms) that is explained where ``share`` of the mean square is."""
    return 1.0 - math.sqrt(1.0 - share)


def nothing_shown(found: Adequacy | None) -> bool:
    """Whether all that speaks against the names is that the user's own model simulates better."""
    return found is not None and found.worse and not found.much_is_left


def adequacy(
    before: Fit,
    after: Fit,
    records: Sequence[Record],
    errors_before: tuple[float, float],
    errors_after: tuple[float, float],
    random_left: bool = False,
    by_torque: Fit | None = None,
    by_motion: Callable[[], float] = lambda: 0.0,
    in_band: float = 0.0,
    follows: Followed | None = None,
    worse: bool = False,
    white: Callable[[], bool] = lambda: False,
) -> Adequacy:
    """Adequacy of what ``after`` has and ``before`` has not, on ``records`` of both kinds; errors: those of
    their free runs on either kind (see `second_method.Errors`); ``random_left``, ``follows``, ``worse``: as
    there, but what is left is not random where names explain less than half and it is more than chance has
    left beside such names, or, where innovations are ``white`` by the strict test, than it leaves where
    nothing is named. ``by_torque``: ``after`` with the sizes that the torques want
    (`SearchResult.by_torque`): where free runs and torques do not agree about sizes, either measure says how
    much the names explain with its own. ``by_motion``: the share of the torque that the inverse dynamics say
    is explained, asked where an observer overflows; ``in_band``: the least that is explained, see
    `explained_in_band`."""
    fits = [before, *(fit for fit in (after, by_torque) if fit is not None)]
    was, *left = added = [added_torque(fit, records) for fit in fits]
    if all(map(_has_a_size, added)):
        explained = max(_share(was, one, SLIGHT_TORQUE) for one in left)
    else:
        explained = min(max(by_motion(), 0.0), 1.0)
    closed = _share(np.array(errors_before), np.array(errors_after), SLIGHT_ERROR)
    # A model that does not follow the motion is none, however much worse another one is.
    followed = _share(np.ones(2), np.array(errors_after), SLIGHT_ERROR)
    torque = max(explained, min(in_band, 1.0))
    if random_left and torque < LEAST_EXPLAINED:
        size = left_size(after, records)
        random_left = size <= MOST_BY_CHANCE or (size <= MOST_UNNAMED and white())
    return Adequacy(torque, min(closed, followed), random_left, 1.0, None if random_left else follows, worse)


def explained_torque(before: Fit, after: Fit, records: Sequence[Record]) -> float:
    """See `Adequacy.torque`."""
    return _share(added_torque(before, records), added_torque(after, records), SLIGHT_TORQUE)


def _has_a_size(added: np.ndarray) -> bool:
    return bool(np.all(added < OVERFLOWS))


def added_torque(fit: Fit, records: Sequence[Record]) -> np.ndarray:
    """Rms of the torques that the observer adds on each record, all equations together, as a share of the rms
    input torque there, (records,); infinite where there is no such observer."""
    return _added(fit, records) / np.maximum(_driven(fit, records), 1e-300)


def _added(fit: Fit, records: Sequence[Record]) -> np.ndarray:
    """These torques, N·m."""

    def rms(record: Record) -> float:
        try:
            torque = after_settling(record, left_over(fit, record).torque)
        except FAILURES:
            return np.inf
        return float(np.sqrt(np.sum(np.mean(torque**2, axis=0))))

    with np.errstate(over="ignore", invalid="ignore"):
        return np.array([rms(record) for record in records])


def _driven(fit: Fit, records: Sequence[Record]) -> np.ndarray:
    """Rms of the input torque, N·m, (records,)."""
    constant = abs(pack(fit.model).torque_constant)
    return np.array([constant * float(np.sqrt(np.mean(r.input**2))) for r in records])


def left_size(fit: Fit, records: Sequence[Record]) -> float:
    """The same over all records, relative to the input over all of them: a record that is quieter than the
    others has the same chance in it, and hardly any input. Infinite where an observer overflows."""
    samples = np.array([len(r) for r in records])
    with np.errstate(over="ignore", invalid="ignore"):
        added, driven = (np.sqrt(samples @ v(fit, records) ** 2) for v in (_added, _driven))
    size = added / max(float(driven), 1e-300)
    return float(size) if _has_a_size(size) else float("inf")


def _share(before: np.ndarray, after: np.ndarray, slight: float) -> float:
    """1 - (left - slight) / (there was - slight), in mean squares."""
    if not np.all(np.isfinite(after)):
        return 0.0
    with np.errstate(over="ignore"):
        left = max(float(np.mean(after**2)) - slight**2, 0.0)
        was = max(float(np.mean(before**2)) - slight**2, 0.0)
    if left <= 0.0:
        return 1.0
    return 0.0 if was <= left else 1.0 - left / was


def following(found: Adequacy | None, followed: Followed | None) -> Adequacy | None:
    """The adequacy where a name that went followed something, which is missing still: of names that are left,
    also of those that the currents show alone. Not where what is left is random."""
    if followed is None or (found is not None and found.random_left):
        return found
    told = found or Adequacy(1.0, 1.0)
    return replace(told, follows=told.follows or followed)


def short_of(result: SearchResult, found: Adequacy) -> tuple[SearchResult, Doubt | None]:
    """The result without names that explain less than LEAST_EXPLAINED of the torque that is missing, and the
    doubt that says so; what is seen in the currents alone stays."""
    moving = [c for c in result.choices if c.chosen.by_current <= 0.0]
    if not moving or found.random_left or found.torque >= LEAST_EXPLAINED:
        return result, None
    names = " and ".join(f"{c.chosen.effect.effect} at {c.chosen.effect.location}" for c in moving)
    why = (
        f"the most similar effect, {names}, explains {100 * found.torque:.0f} % of the torque that the "
        "structure alone lacks to follow the recordings"
    )
    return result.without_names(moving, why), Doubt(moving[0], why, short=True)
