"""An encoder's error that the torques speak against."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.likelihood import FAILURES
from haptic_teleop_sysid.estimation.records import Record

from ...evidence.inverse_dynamics.corrected import can_correct, corrected, torques_left
from ...hypotheses.follows import follows_from_input, follows_from_motion
from ...policy import FITS_BETTER, FITS_WORSE
from ..search.decide import Choice
from ..search.rounds import SearchResult


def misread(
    result: SearchResult, given: Model, learn: Sequence[Record], judge: Sequence[Record], cutoff: float
) -> tuple[SearchResult, tuple[Choice, str] | None]:
    """What the torques say of findings that are errors of an encoder, following the angle: the result, in
    which nobody is sure of one that they do not confirm, and the first one with whose correction they fit
    clearly worse, with why it is given up; None where there is none. Asked of rigid joints, whose equation
    holds nothing else of the readings. ``cutoff``: Hz, of the band of the motion."""
    if not given.rigid:
        return result, None
    effects = [c.chosen.effect for c in result.choices]
    group = [e for e in effects if follows_from_motion(e.entry) or follows_from_input(e.entry)]
    choices = [*result.choices]
    for number, error in enumerate(effects):
        if error.entry.kind != "output" or not can_correct(error):
            continue
        try:
            raw = torques_left(given, learn, judge, group, cutoff)
            here, there = ([corrected(r, error) for r in records] for records in (learn, judge))
            right = torques_left(given, here, there, group, cutoff)
        except FAILURES:
            continue
        name = error.effect.replace("_", " ")
        if right > FITS_WORSE * raw:
            return replace(result, choices=tuple(choices)), (
                choices[number],
                f"with the {name} taken out of the readings, the torques fit worse: {right / raw:.2g} times "
                "as much of them is left",
            )
        if right > FITS_BETTER * raw:
            unsure = (
                f"the torques do not confirm it: {100.0 * right / raw:.0f} % of what is left of them stays "
                f"with the {name} taken out of the readings"
            )
            choices[number] = replace(choices[number], unsure=unsure)
    return replace(result, choices=tuple(choices)), None
