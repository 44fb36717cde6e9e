"""How fast does a joint move as its record begins? As the observer finds out later.

An observer that trusts its model forgets a wrong speed slowly, and what acts only at the beginning passes for
physics that acts at one place. Innovations are linear in the first state: the state that makes all of them
smallest is a least squares away (a fixed-point smoother: Gelb, Applied Optimal Estimation, 1974).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.kernel import Packed, pack

from .fit import Fit
from .likelihood import FAILURES, channels, innovation_covariance, innovations, likelihood_of, seen
from .noise import NoiseModel
from .records import Record
from .whitening import whitening_weight

FloatArray = NDArray[np.float64]

#: Log-likelihood that is gained by another first state, from which it is taken: by chance, and where the
#: innovations are white, it is half a nat for each part of the state. Of 200 joints, real and simulated,
#: three real ones gain more, two of which begin in motion.
_GAINED = 6.0
#: Part of an encoder's step, and of a step a sample, by which the first state is moved to see what answers.
_MOVED = 1.0


def from_first_state(fit: Fit, records: list[Record]) -> list[Record]:
    """The records, each with the first angles and speeds that the observer of a ``fit`` wants, where the
    innovations that count are clearly smaller by it; as it is where it begins at rest or arithmetic fails.
    The same list where all are as they are."""
    packed = pack(fit.model)
    found = [_from_first_state(packed, fit.noise, record) for record in records]
    return records if all(a is b for a, b in zip(found, records, strict=True)) else found


def _from_first_state(packed: Packed, noise: NoiseModel, record: Record) -> Record:
    if record.at_rest:
        return record
    try:
        motor, arm, *speeds = np.add((*record.offsets, *record.rates), _wanted(packed, noise, record))
    except FAILURES:
        return record
    begun = replace(record, offsets=(float(motor), float(arm)), rates=(float(speeds[0]), float(speeds[1])))
    # Friction, a stop or a backlash of the model is not linear in it.
    gained = likelihood_of(packed, noise, [begun]) - likelihood_of(packed, noise, [record])
    return begun if gained > _GAINED else record


def _wanted(packed: Packed, noise: NoiseModel, record: Record) -> FloatArray:
    """Change of the first state (4,) by which the innovations are smallest."""
    used = len(channels(packed, record))
    run = innovations(packed, noise, record).innovation
    step = _MOVED * record.resolution[0]
    moves = np.zeros((2 * used, 4))
    for i in range(used):
        # What is read of one encoder alone moves both angles.
        sides = [i] if used == 2 else [0, 1]
        moves[i, sides] = step
        moves[used + i, [2 + side for side in sides]] = step / record.dt
    answers = []
    for move in moves:
        there = replace(
            record,
            offsets=(record.offsets[0] + move[0], record.offsets[1] + move[1]),
            rates=(record.rates[0] + move[2], record.rates[1] + move[3]),
        )
        answers.append(innovations(packed, noise, there).innovation - run)
    weight = whitening_weight(innovation_covariance(packed, record, run))
    read = np.flatnonzero(seen(packed, record)[:, :used].all(axis=1))
    errors, *columns = ((one[read, :used] @ weight).reshape(-1) for one in (run, *answers))
    slopes = np.column_stack(columns)
    values = -np.linalg.lstsq(slopes, errors, rcond=1e-9)[0]
    return np.asarray(values @ moves)
