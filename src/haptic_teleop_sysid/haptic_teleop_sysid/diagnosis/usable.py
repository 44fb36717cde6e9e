"""Recordings as records that a diagnosis can use; what it cannot use is refused in a sentence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_sysid.estimation.records import LONGEST_HOLE, Record, records_from
from haptic_teleop_sysid.recordings.dataset import DataSet

from .evidence.consistency import refuse_other_signs, refuse_other_units, refuse_unrelated
from .inputs.cuts import SHORTEST_STRETCH
from .inputs.plausible import (
    refuse_constant_input,
    refuse_copies,
    refuse_idle,
    refuse_kinematic,
    refuse_motionless,
)

#: Difference (A or N·m, relative to the rms command) up to which the measured current counts as following.
_FOLLOWS = 0.1
#: Holes, share of them that have one length but for a sample, and share of the samples that are missing, from
#: which an angle is read seldom.
_MANY_HOLES, _ALIKE, _MISSING = 50, 0.8, 0.25


def records_of(data: list[DataSet]) -> list[Record]:
    """Records driven by the command, cut apart at holes; refused where there is nothing to learn from."""
    records = []
    for dataset in data:
        seldom = samples_a_reading(dataset.valid)
        if seldom > LONGEST_HOLE:
            # Where the joint is slow such readings pass for good ones, and only these would be used.
            raise RecordingError(
                f"{dataset.name}: an angle of {dataset.joint} is read about once in {seldom:.0f} samples "
                f"(every {seldom * dataset.dt:.3g} s), which is too seldom for a log at "
                f"{1.0 / dataset.dt:.0f} Hz: write one row for each reading, with the mean of the input "
                "since the last one."
            )
        pieces = records_from(dataset, commanded=True)
        longest = max(pieces, key=len)
        if len(longest) < SHORTEST_STRETCH:
            raise RecordingError(
                f"{dataset.name} has {len(longest)} samples without a hole; a diagnosis needs at least "
                f"{SHORTEST_STRETCH} in a row: record for longer, or leave it out."
            )
        used = [piece for piece in pieces if len(piece) >= SHORTEST_STRETCH]
        refuse_motionless(used, dataset.joint)
        driven = [piece for piece in used if np.ptp(piece.input) > 0.0]
        if driven:  # an input may change from piece to piece alone
            refuse_unrelated(max(driven, key=len), dataset.joint)
        records += used
    return records


def samples_a_reading(valid: NDArray[np.bool_]) -> float:
    """Samples from one reading to the next, where most readings stand alone between holes of one length; 1
    where they do not."""
    edges = np.flatnonzero(np.diff(np.concatenate([[1], valid.astype(np.int8), [1]])))
    holes, between = edges[1::2] - edges[::2], edges[2::2] - edges[1:-1:2]
    usual = float(np.median(holes)) if len(holes) >= _MANY_HOLES else 0.0
    alike = float(np.mean(np.abs(holes - usual) <= 1)) if usual else 0.0
    if alike < _ALIKE or np.median(between) > 1 or np.mean(~valid) < _MISSING:
        return 1.0
    return usual + 1.0


def sense_follows(data: list[DataSet]) -> bool:
    """Whether a measured current was recorded that follows its command without further delay."""
    for dataset in data:
        if dataset.commanded_input is None or dataset.input_source != "measured effort":
            return False
        rms = float(np.std(dataset.commanded_input))
        noise = 0.02 if dataset.input_unit == "A" else 0.0
        if float(np.std(dataset.input - dataset.commanded_input)) > _FOLLOWS * rms + noise:
            return False
    return True


def refuse_unusable(*kinds: Sequence[DataSet]) -> None:
    """Raise RecordingError for recordings that a diagnosis cannot use, alone or together; ``kinds``: those to
    fit to, to judge by, to show."""
    recordings = [dataset for kind in kinds for dataset in kind]
    refuse_copies(recordings)
    refuse_idle(recordings)
    records = [record for kind in kinds for record in records_of([*kind])]
    refuse_constant_input(kinds[0])
    refuse_kinematic(kinds[0], [dataset for kind in kinds[1:] for dataset in kind])
    refuse_other_units(records)
    refuse_other_signs(records)
