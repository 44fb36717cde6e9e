"""Recordings as records that a diagnosis can use; what it cannot use is refused in a sentence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_sysid.estimation.records import Record, records_from
from haptic_teleop_sysid.recordings.dataset import DataSet

from .evidence.consistency import refuse_other_units, refuse_unrelated
from .inputs.cuts import FEWEST_SAMPLES, SHORTEST_STRETCH
from .inputs.plausible import (
    refuse_constant_input,
    refuse_copies,
    refuse_idle,
    refuse_kinematic,
    refuse_motionless,
)

#: Difference (A or N·m, relative to the rms command) up to which the measured current counts as following.
_FOLLOWS = 0.1


def records_of(data: list[DataSet]) -> list[Record]:
    """Records driven by the command, cut apart at holes; refused where there is nothing to learn from."""
    records = []
    for dataset in data:
        pieces = records_from(dataset, commanded=True)
        longest = max(pieces, key=len)
        if len(longest) < SHORTEST_STRETCH:
            raise RecordingError(
                f"{dataset.name} has {len(longest)} samples without a hole; a diagnosis needs at least "
                f"{SHORTEST_STRETCH} in a row, and {FEWEST_SAMPLES} in all: record for longer, or leave it "
                "out."
            )
        refuse_motionless(longest, dataset.joint)
        refuse_unrelated(longest, dataset.joint)
        records += [piece for piece in pieces if len(piece) >= SHORTEST_STRETCH]
    together = sum(map(len, records))
    if records and together < FEWEST_SAMPLES:
        raise RecordingError(
            f"{', '.join(d.name for d in data)}: {together} samples in all; a diagnosis needs at least "
            f"{FEWEST_SAMPLES} of each kind (estimation, validation, test): record for longer."
        )
    return records


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
    for dataset in recordings:
        refuse_kinematic(dataset)
    refuse_other_units(records)
