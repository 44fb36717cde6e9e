"""What an effect's entry says to those who look for it: when it deserves its name, what looks the same, and
from where its richer forms are fitted."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

#: Numbers of an effect, by the names of its parameters.
Numbers = Mapping[str, float]


@dataclass(frozen=True)
class Recorded:
    """What recordings are like where an effect sits.

    ``size``: typical sizes in SI units, by the names of ``EffectParameter.scale``; ``lowest`` and
    ``highest``: angles reached there, rad; ``dt``: sample period, s; ``resolution``: of the encoder there,
    and ``coarsest`` of all encoders, rad; ``sticking``: displacement up to which a contact that gives counts
    as one that sticks, rad; ``both_ways``: how far it moved in one direction, of what it did in the other, 0
    to 1.
    """

    size: Mapping[str, float]
    lowest: float
    highest: float
    dt: float
    resolution: float
    coarsest: float
    sticking: float
    both_ways: float = 1.0

    @property
    def span(self) -> float:
        """How far the place moved, rad."""
        return self.highest - self.lowest


@dataclass(frozen=True)
class Equivalent:
    """Another effect that looks the same: ``effect``, for an effect at one of the places ``at``.

    ``numbers(p)``: its parameters where the effect has ``p``; {} where it has no such equivalent at these;
    None: the same numbers. ``across``: it sits on the other side of the joint; ``place``: at this place of
    it, where that is another one. ``condition``: under which recordings do not tell the two apart, in words;
    empty where none of these channels ever does, or none of a joint that is ``rigid``.
    """

    effect: str
    at: tuple[str, ...]
    numbers: Callable[[Numbers], dict[str, float]] | None = None
    across: bool = False
    place: str = ""
    condition: str = ""
    rigid: bool = False


def as_early(p: Numbers) -> dict[str, float]:
    """A delay as another channel that is stamped as early: of two channels one is late where the other one is
    early."""
    return {"delay": -p["delay"]} if p["delay"] != 0.0 else {}


@dataclass(frozen=True)
class Refinement:
    """The effect as a richer form of a plainer one, ``of``. ``starts(p, on, scanned)``: parameters to fit it
    from where the plainer one came to ``p``; ``scanned``: a value of the parameter that is scanned, for an
    effect that has one."""

    of: str
    starts: Callable[[Numbers, Recorded, float], Iterator[dict[str, float]]]


#: Whether an effect with these parameters deserves its name on such recordings.
Practical = Callable[[dict[str, float], Recorded], bool]
#: Why nobody is sure of an effect with these parameters on such recordings, in words; "" for nothing.
Doubtful = Callable[[dict[str, float], Recorded], str]

#: Least size of a torque, as a share of the rms input torque. A fit always finds some; by hand.
SMALL_TORQUE = 0.0001
#: A form of friction is called by its own name when it departs from plain friction by this share; by hand.
DISTINCT = 0.2
#: Least delay as a share of the sample period: less is not told from how the samples were taken; by hand.
SHARE_OF_SAMPLE = 0.003
#: Share of the way in one direction that a joint goes in the other at least, where both are told apart; by
#: hand.
BOTH_WAYS = 0.02
#: Share of its largest torque by which a pull towards an angle changes over the travel; by hand.
CHANGES = 0.1
#: Share of the recording over which a drift takes place at least: what has changed as soon as the recording
#: begins does not drift; by hand.
AT_ONCE = 0.02

#: Cycles from which a sine repeats: the third half-wave is the first that confirms the others.
REPEATED = 1.5


def noticeable(name: str, times: float = 1.0) -> Practical:
    """The parameter of that name is a torque above the least one (``times`` as much)."""
    return lambda p, on: abs(p[name]) > times * SMALL_TORQUE * on.size["torque"]


def late(name: str) -> Practical:
    """The parameter of that name is a time that the samples can tell."""
    return lambda p, on: abs(p[name]) > SHARE_OF_SAMPLE * on.dt


def drifts(p: Numbers, on: Recorded) -> bool:
    """A ``change`` that is one, over a ``time_constant`` that the recording sees pass."""
    return abs(p["change"]) > 0.003 and p["time_constant"] > AT_ONCE * on.size["duration"]


def bends(p: Numbers, on: Recorded) -> bool:
    """A quarter of a cycle of ``order`` was seen: less of a sine is a slope, not an order."""
    return p["order"] * on.span > math.pi / 2


def repeats(p: Numbers, on: Recorded) -> bool:
    """Six tenths of a cycle of ``order`` were seen: less is one hill or valley, as gravity has it."""
    return p["order"] * on.span > 1.2 * math.pi


def seen_once(p: Numbers, on: Recorded) -> str:
    """Nobody knows that a curve over the angle repeats of which no third half-wave was seen."""
    cycles = p["order"] * on.span / (2.0 * math.pi)
    if cycles >= REPEATED:
        return ""
    return (
        f"{cycles:.2g} of its cycles lie in the travel: any curve over that angle may look like that, so "
        "record over more of it"
    )
