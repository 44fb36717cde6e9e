"""Simulations laid over several recordings, as pictures and as a table of their fits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from haptic_teleop_control.errors import HapticTeleopError
from haptic_teleop_control.recording import Recording
from haptic_teleop_sysid.recordings.small_motion import SMALLEST_SPREAD, spread
from haptic_teleop_sysid.report import Panel, Plot, Series
from haptic_teleop_sysid.verification.overlay import Comparison, Overlay, overlay
from haptic_teleop_sysid.verification.simulation import can_be_simulated, simulate_recording

#: What is said instead of a fit of a signal that hardly varies, by its unit.
HARDLY = {"rad": "hardly moves", "rad/s": "hardly moves", "N·m": "hardly varies"}


@dataclass(frozen=True)
class Overlays:
    """By a run's label: what was laid over it, the pictures of that by group, or why there is nothing."""

    done: dict[str, Overlay]
    pictures: dict[str, dict[str, Plot]]
    reasons: dict[str, str]


def overlay_all(
    recordings: Mapping[str, Recording], scenario: str | None, remove_delay: bool, trust_code: bool = False
) -> Overlays:
    """Simulate each of `recordings` (label -> recording) and lay it over; errors as `simulate_recording`.
    Without a `scenario` file those that cannot be simulated are left out, with the reason. trust_code: as for
    `simulate_recording`.
    """
    done: dict[str, Overlay] = {}
    reasons: dict[str, str] = {}
    for label, recording in recordings.items():
        try:
            reason = can_be_simulated(recording, trust_code) if scenario is None else None
            if reason is None:
                simulated = simulate_recording(recording, label, scenario, trust_code)
                done[label] = overlay(recording, simulated, remove_delay)
        except HapticTeleopError as error:
            if scenario is not None:  # somebody asked for it
                raise
            reason = _without_name(str(error).rstrip("."), label)
        if reason is not None:
            reasons[label] = reason
    return Overlays(done, {label: overlay_pictures(one) for label, one in done.items()}, reasons)


def _without_name(sentence: str, label: str) -> str:
    """What is said of the run `label`, as the end of a sentence that begins with its name."""
    if sentence.startswith(f"{label} "):
        return sentence.removeprefix(f"{label} ")
    return f"cannot be simulated here: {sentence.removeprefix(f'{label}: ')}"


def fit_in_words(one: Comparison, unit: str = "") -> str:
    """The fit as text, or that there is none because the signal hardly varies: what is a large share of next
    to nothing is no alarm."""
    return HARDLY[one.unit] if one.fit is None else f"{one.fit:.1f}{unit}"


def overlay_pictures(result: Overlay) -> dict[str, Plot]:
    """Return a plot for each group of which a signal varies: the recording over its simulation."""
    pictures = {}
    for group in dict.fromkeys(one.group for one in result.comparisons):
        members = [one for one in result.comparisons if one.group == group]
        if all(one.fit is None for one in members):
            continue
        panels = [
            Panel(
                one.name.capitalize(),
                one.unit,
                [
                    Series("recording", one.time, one.recorded),
                    Series("simulation", one.time, one.simulated, "given"),
                ],
                note=f"{'' if one.fit is None else 'fit '}{fit_in_words(one, ' %')}",
            )
            for one in members
        ]
        since = "the simulation's first state, delay removed" if result.removed else "the first state of each"
        pictures[group] = Plot(panels, x_label=f"time since {since} (s)").with_difference()
    return pictures


def overlay_table(overlays: Mapping[str, Overlay]) -> tuple[list[str], list[list[object]], str]:
    """Return header, rows and caption of all fits."""
    header = ["signal", "fit (%)", "moves by", "run", "delay (s)"]
    rows: list[list[object]] = [
        [
            f"{entry.group}, {entry.name}",
            fit_in_words(entry),
            f"{spread(entry.recorded):.3g} {entry.unit}",
            label,
            f"{one.delay:.3f}",
        ]
        for label, one in overlays.items()
        for entry in one.comparisons
    ]
    least = ", ".join(f"{value:g} {unit}" for unit, value in SMALLEST_SPREAD.items())
    caption = f"100·(1 − ‖y − ŷ‖/‖y − mean y‖) over the recording; hardly: by less than {least}"
    return header, rows, caption
