"""What the other recordings say nothing of.

A stop that only the recordings reach to which it was fitted changes the inertia and the damping found beside
it, and so what the other recordings are simulated to; none of that speaks for the stop. Whether they say
anything of a finding shows where they are simulated with it and without it, all else the same.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.model import Model

from ..search.rounds import SearchResult

#: Difference (rms) that a finding makes to some simulated signal, relative to its spread, where it acts at
#: all: how much is enough to be seen, the likelihood of the recordings has said.
_DIFFERENCE = 1e-6

#: Simulated signals of a model, by name, for each validation recording.
Responses = Callable[[Model], Sequence[Mapping[str, NDArray[np.float64]]]]


def unconfirmed(result: SearchResult, responses: Responses) -> SearchResult:
    """The result, in which nobody is sure of a finding that changes nothing in the simulated validation
    recordings, or that its entry calls doubtful on such recordings; what shows in the currents is not asked.
    """
    final = result.final.model
    choices = []
    for choice in result.choices:
        effect = choice.chosen.effect
        without = final.without(effect.effect, effect.location)
        asked = not (choice.unsure or choice.chosen.by_current > 0.0)
        doubtful = effect.entry.doubtful
        if asked and doubtful and (why := doubtful(effect.values, result.scales.at(effect.location))):
            choice = replace(choice, unsure=why)
        elif asked and _same(responses(final), responses(without)):
            name = effect.effect.replace("_", " ")
            unsure = (
                f"the validation recordings say nothing of it: they are simulated alike with the {name} and "
                "without, so record one that reaches it"
            )
            choice = replace(choice, unsure=unsure)
        choices.append(choice)
    return replace(result, choices=tuple(choices))


def _same(
    one: Sequence[Mapping[str, NDArray[np.float64]]], other: Sequence[Mapping[str, NDArray[np.float64]]]
) -> bool:
    """Whether all signals differ by less than _DIFFERENCE of their spread."""
    for signals, others in zip(one, other, strict=True):
        for name, values in signals.items():
            apart = float(np.sqrt(np.nanmean((values - others[name]) ** 2)))
            if not apart < _DIFFERENCE * float(np.nanstd(values)):
                return False
    return True
