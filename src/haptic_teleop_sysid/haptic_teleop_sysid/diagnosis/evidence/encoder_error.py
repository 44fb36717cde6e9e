"""Readings of an encoder without an error that has a name."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from haptic_teleop_sim.effects import EffectEntry
from haptic_teleop_sim.effects.on_arrays import NUMERIC
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.estimation.records import Record

#: How often the error is evaluated at an angle that is without it: it changes slowly with the angle.
_ROUNDS = 5


def is_reading_error(entry: EffectEntry) -> bool:
    """Whether an effect is an error of what an encoder reads that follows from the angle or its time."""
    return entry.kind in ("output", "skew") and not entry.momentary


def without_error(record: Record, effect: Effect, channel: int) -> Record:
    """``record`` with the true angles of motor (0) or arm (1), were ``effect`` all that its encoder does to
    them; missing where a reading is."""
    read = record.measured[:, channel]
    if effect.entry.kind == "skew":
        true = _earlier(read, sum(effect.parameters.values()) / record.dt)
    else:
        true = _inverted(read, effect)
    measured = record.measured.copy()
    measured[:, channel] = true
    return replace(record, measured=measured)


def _earlier(read: np.ndarray, samples: float) -> np.ndarray:
    """Readings that are so many ``samples`` late, at their time; the first or last one beyond the ends."""
    there = np.flatnonzero(np.isfinite(read))
    place = np.arange(len(read), dtype=float)
    found = np.interp(place + samples, place[there], read[there])
    return np.where(np.isfinite(read), found, np.nan)


def _inverted(read: np.ndarray, effect: Effect) -> np.ndarray:
    equation = effect.entry.equation
    assert equation is not None
    parameters, true = SimpleNamespace(**effect.values), read
    for _ in range(_ROUNDS):
        at = SimpleNamespace(position=true, **NUMERIC)
        true = true + read - np.asarray(equation(at, parameters), dtype=float)
    return true
