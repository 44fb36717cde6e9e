"""What lies between a command and the current cannot be missing where the current itself was recorded.

A log rarely says which of the two its input is. One that is smooth between its samples (see
`inputs.between_samples`) may be a measured current: that has been through the amplifier's limits, and what
looks like another limit is something else.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from haptic_teleop_sysid.recordings.dataset import DataSet

from ..search.decide import Choice
from ..search.rounds import SearchResult


def of_measured_input(result: SearchResult, read: bool, data: Sequence[DataSet]) -> SearchResult:
    """The result, in which nobody is sure of a limit of the command where the input was taken as ``read`` and
    the recordings do not have the command beside the current; what shows in the currents is not asked."""
    if not read or all(d.commanded_input is not None for d in data):
        return result
    return replace(result, choices=tuple(_unsure(c) if _asked(c) else c for c in result.choices))


def _asked(choice: Choice) -> bool:
    chosen = choice.chosen
    return chosen.effect.entry.of_command and chosen.by_current <= 0.0 and not choice.unsure


def _unsure(choice: Choice) -> Choice:
    name = choice.chosen.effect.effect.replace("_", " ")
    told = (
        f"if the input of this log is a measured current, it is no {name}: such a current shows what is left "
        "already, so record the command beside it"
    )
    return replace(choice, unsure=told)
