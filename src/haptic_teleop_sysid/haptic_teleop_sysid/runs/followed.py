"""How well a fit follows a recording, in words: the one scale of `compare` and of `estimate`."""

from __future__ import annotations

from haptic_teleop_sysid.report import Status

#: Mean fit (percent) from which a model is close to a recording, and from which it is roughly right.
CLOSE, ROUGH = 90.0, 70.0
#: Fit (percent) below which a signal is followed no better than by its mean.
USELESS = 0.0
_ORDER: tuple[Status, ...] = ("bad", "fair", "good")


def of_mean(percent: float) -> Status:
    """What a mean fit over the signals is worth."""
    return "good" if percent >= CLOSE else "fair" if percent >= ROUGH else "bad"


def of_worst(percent: float) -> tuple[Status, str] | None:
    """What the fit of the signal that is followed worst is worth, and the word for it; None where it is
    close."""
    if percent >= CLOSE:
        return None
    if percent >= ROUGH:
        return "good", "fair"
    return ("fair", "poor") if percent >= USELESS else ("bad", "no better than a constant")


def worse(one: Status, other: Status) -> Status:
    """The worse of two."""
    return min((one, other), key=_ORDER.index)
