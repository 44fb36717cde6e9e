"""Reasons to doubt a name, or that nothing is amiss: what is left runs away, is off the mark, happened at one
moment, at some times or at one frequency; or an encoder slipped."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.recordings.dataset import DataSet

from ..evidence.events import bursts, moment, steady_line
from ..evidence.fine_curve import follows_input_finely
from ..evidence.held_out import held_out_fit
from ..evidence.residual import INPUT_TORQUE
from ..policy import MOST_UNNAMED, NOTICEABLE
from .search.decide import Choice


@dataclass(frozen=True)
class Doubt:
    """``choice``: the finding that was given up, None where nothing was named; ``why`` in words;
    ``condition``: when the mismatch shows, where that is not when the finding's effect would; ``intervals``:
    the same on the first recording, s; ``place``: where it is, if known; ``short``: all that speaks against
    the name is that it explains too little."""

    choice: Choice | None
    why: str
    condition: str | None = None
    intervals: tuple[tuple[float, float], ...] = ()
    place: str | None = None
    short: bool = False


def off_the_mark(percent: Mapping[str, float]) -> Doubt | None:
    """Doubt where nothing was found and a velocity of the validation recordings is simulated worse than
    its mean would predict it. ``percent``: fit by signal.

    The noise levels of other recordings are their own, so that the observer of a wrong unit or sign is merely
    one that corrects much: nothing in the innovations says so.
    """
    velocities = {name: p for name, p in percent.items() if name.endswith(".velocity")}
    worst = min(velocities, key=lambda name: velocities[name], default=None)
    if worst is None or velocities[worst] >= 0.0:
        return None
    why = (
        f"the given structure simulates {worst} of the validation recordings worse "
        f"({velocities[worst]:.0f} %) than its mean would: see whether they have the units, "
        "the signs and the joint of the others"
    )
    return Doubt(None, why, "throughout")


def more_than_chance(size: float) -> Doubt | None:
    """Doubt where nothing was found and the torque that the observer adds is more than chance.

    ``size``: its rms as a share of the input's."""
    if size <= MOST_UNNAMED or not math.isfinite(size):
        return None
    why = (
        f"a torque of {100 * size:.0f} % of the input's (rms) is missing, more than chance is on a machine, "
        "and it follows nothing that was recorded"
    )
    return Doubt(None, why, "time")


def follows_in_detail(fits: Sequence[tuple[Fit, Sequence[Record]]], driven: float) -> Doubt | None:
    """Doubt where nothing was found and a noticeable torque follows the input in detail; ``fits``: of the
    structure with both kinds of recordings; ``driven``: rms torque of the input, N·m."""
    size = follows_input_finely(fits)
    if not size > NOTICEABLE * driven:
        return None
    why = (
        f"a torque of {100 * size / driven:.0f} % of the input's (rms) is missing that is another one at "
        "each value of the input, in steps too fine for a law or a map: see how coarse the converter is, and "
        "how the command is rounded"
    )
    return Doubt(None, why, INPUT_TORQUE, place=fits[0][0].model.location("actuator"))


def rather_event(doubt: Doubt, fits: Sequence[tuple[Fit, Sequence[Record]]]) -> Doubt:
    """The doubt, or what says more than it: that what is left acts at one frequency whatever the joint does,
    or at some times, and when; ``fits``: those that leave it, with both kinds of recordings."""
    line = steady_line(fits)
    if line is not None:
        why = (
            f"something acts at {line:.4g} Hz whatever the joint does: a hum, a fan, a floor that shakes, or "
            "what has its frequency above half the sampling rate"
        )
        return replace(doubt, why=why, condition=f"frequency {line:.4g} Hz", place=None)
    when = bursts(fits)
    if when is None or (doubt.choice is not None and when.condition != "time"):
        return doubt
    first, *more = when.intervals[0]
    why = f"something acts at some times and not at others, first from {first[0]:g} to {first[1]:g} s"
    why += f" and {len(more)} more times on that recording" if more else ""
    if when.condition != "time":
        why += f", always at {when.condition}"
    return replace(doubt, why=why, condition=when.condition, intervals=when.intervals[0])


def slipped(recordings: Sequence[DataSet]) -> Doubt | None:
    """The doubt where nothing was named and encoders had to be put back: the machine is not what the model
    says, for a moment."""
    found = [(d, slip) for d in recordings for slip in d.slips]
    if not found:
        return None
    dataset, slip = found[0]
    why = (
        f"{slip.encoder} reads {slip.size:.4g} rad elsewhere from {slip.time:.3f} s of {dataset.name} on, "
        "as if it slipped or lost counts"
    )
    why += f" ({len(found)} times in all)" if len(found) > 1 else ""
    times = tuple((s.time, s.time) for d, s in found if d is recordings[0] and s.encoder == slip.encoder)
    return Doubt(None, f"{why}; what follows was put back", "time", times, slip.encoder)


def runs_away(choice: Choice) -> Doubt:
    """The doubt about a finding that predicts the next sample better and runs away when it runs freely:
    something is there, and it is not that."""
    name = choice.chosen.effect.effect
    return Doubt(
        choice,
        f"with {name} each next sample is predicted better, but recordings are simulated worse",
    )


def momentary(
    choice: Choice, before: Fit, estimation: Sequence[Record], validation: Sequence[Record]
) -> tuple[str, str | None] | None:
    """The objection that all that speaks for a finding happened at one moment of each kind of recordings,
    although its effect acts all the time."""
    chosen = choice.chosen
    if chosen.effect.entry.momentary or chosen.by_current > 0.0:
        return None
    fit = chosen.fit
    then = moment(before, fit, estimation)
    if then is None:
        return None
    there = [held_out_fit(f, validation, [before.noise, fit.noise]) for f in (before, fit)]
    if moment(there[0], there[1], validation) is None:
        return None
    why = (
        f"all that speaks for {chosen.effect.effect} happened at {then:.1f} s, and it would act at other "
        "times, too"
    )
    return why, "time"
