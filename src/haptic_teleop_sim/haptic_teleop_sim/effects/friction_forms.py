"""The forms of dry friction: from where each is fitted once a plain one is known, and when it departs from
that by enough to bear its own name."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from .hypothesis import BOTH_WAYS, DISTINCT, SMALL_TORQUE, Numbers, Recorded, bends
from .parameter import CONTACT, STICTION_ANGLE

#: Shares of the rms velocity over which a friction that falls with speed is begun, shares of the travel over
#: which a contact that gives is, and phases of a sine, of which a wrong one leads back to none.
_VELOCITIES = (0.05, 0.2, 0.6)
_GIVES = (0.01, 0.05)
_HARDLY = (0.05, 0.15, 0.5)
_PHASES = (0.0, 0.5 * math.pi, math.pi, 1.5 * math.pi)
#: Share by which friction varies with the angle in the beginning.
_VARIES = 0.3
#: Share of the whole travel up to which a contact that gives before it slides bears its own name: one that
#: hardly ever slides is a spring.
_STILL = 1.0


def _given_contact(p: Numbers) -> dict[str, float]:
    """What a friction states of its contact."""
    return {q.name: p[q.name] for q in CONTACT if q.name in p}


def falling(p: Numbers, on: Recorded, scanned: float) -> Iterator[dict[str, float]]:
    """Less at speed and more where sliding starts than a plain friction, over several velocities."""
    for share in _VELOCITIES:
        velocity = share * on.size["velocity"]
        own = {"coulomb": 0.6 * p["torque"], "breakaway": 1.1 * p["torque"], "velocity": velocity}
        yield {**own, **_given_contact(p)}


def sided(p: Numbers, on: Recorded, scanned: float) -> Iterator[dict[str, float]]:
    """More in either direction than a plain friction, and less in the other."""
    for more, less in ((1.2, 0.8), (0.8, 1.2)):
        own = {"positive": more * p["torque"], "negative": less * p["torque"]}
        yield {**own, **_given_contact(p)}


def giving(p: Numbers, on: Recorded, scanned: float) -> Iterator[dict[str, float]]:
    """A contact that gives over a share of the travel."""
    for share in _GIVES:
        yield {"torque": p["torque"], "stiffness": p["torque"] / (share * on.span)}


def hardly_sliding(p: Numbers, on: Recorded, scanned: float) -> Iterator[dict[str, float]]:
    """A contact that gives over so much of the travel that it passed for a spring."""
    for share in _HARDLY:
        yield {"torque": p["stiffness"] * share * on.span, "stiffness": p["stiffness"]}


def rippled(p: Numbers, on: Recorded, scanned: float) -> Iterator[dict[str, float]]:
    """A plain friction that varies with the angle at the scanned order, at every phase."""
    contact = {"contact_angle": p.get("contact_angle", STICTION_ANGLE)}
    for phase in _PHASES:
        own = {"torque": p["torque"], "amplitude": _VARIES * p["torque"], "order": scanned, "phase": phase}
        yield {**own, **contact}


def falls(p: Numbers, on: Recorded) -> bool:
    """Breakaway well above what slides, over a velocity that the motion has."""
    return (
        p["breakaway"] > (1 + DISTINCT) * p["coulomb"]
        and p["breakaway"] > SMALL_TORQUE * on.size["torque"]
        and p["velocity"] > 1e-3 * on.size["velocity"]
    )


def by_gauss(s: Any, p: Any) -> Any:
    """Falls as a Gauss curve of the velocity (Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica
    30(7), 1994, with the exponent 2)."""
    return -(p.coulomb + (p.breakaway - p.coulomb) * s.exp(-((s.velocity / p.velocity) ** 2))) * s.direction


def by_exponential(s: Any, p: Any) -> Any:
    """Falls as an exponential of the speed (Tustin 1947; the same with the exponent 1)."""
    return -(p.coulomb + (p.breakaway - p.coulomb) * s.exp(-s.abs(s.velocity) / p.velocity)) * s.direction


def differs(p: Numbers, on: Recorded) -> bool:
    """One direction well above the other, in a friction that is one, of a joint that moves in both."""
    less, more = sorted((p["positive"], p["negative"]))
    large = less + more > 2 * SMALL_TORQUE * on.size["torque"]
    return more > (1 + DISTINCT) * less and large and on.both_ways > BOTH_WAYS


def gives(p: Numbers, on: Recorded) -> bool:
    """A contact that gives farther than one that sticks, and slides well within the travel."""
    gives = p["torque"] / p["stiffness"]
    return p["torque"] > SMALL_TORQUE * on.size["torque"] and on.sticking < gives < _STILL * on.span


def varies(p: Numbers, on: Recorded) -> bool:
    """An amplitude well above nothing, of a sine of which enough was seen."""
    return (
        p["amplitude"] > DISTINCT * max(p["torque"], 1e-12)
        and p["amplitude"] > SMALL_TORQUE * on.size["torque"]
        and bends(p, on)
    )


def grows(p: Numbers, on: Recorded) -> bool:
    """More than a few thousandths of what is transmitted."""
    return p["coefficient"] > 0.002
