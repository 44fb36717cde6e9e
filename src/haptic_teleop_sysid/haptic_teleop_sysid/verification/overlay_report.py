"""Simulations laid over several recordings, as pictures and as a table of their fits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from matplotlib.figure import Figure

from haptic_teleop_control.errors import HapticTeleopError
from haptic_teleop_control.recording import Recording
from haptic_teleop_sysid.report import Panel, Series, stacked_panels
from haptic_teleop_sysid.verification.overlay import SMALLEST_SPREAD, Overlay, overlay
from haptic_teleop_sysid.verification.simulation import can_be_simulated, simulate_recording

HARDLY = "hardly varies"


@dataclass(frozen=True)
class Overlays:
    """By a run's label: what was laid over it, the pictures of that by group, or why there is nothing."""

    done: dict[str, Overlay]
    pictures: dict[str, dict[str, Figure]]
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
            reason = f"cannot be simulated here ({str(error).rstrip('.')})"
        if reason is not None:
            reasons[label] = reason
    return Overlays(done, {label: overlay_pictures(one) for label, one in done.items()}, reasons)


def fit_in_words(fit: float | None, unit: str = "") -> str:
    """The fit as text, or that there is none because the signal hardly varies."""
    return HARDLY if fit is None else f"{fit:.1f}{unit}"


def overlay_pictures(result: Overlay) -> dict[str, Figure]:
    """Return a figure for each group of which a signal varies: simulation over recording."""
    pictures = {}
    for group in dict.fromkeys(one.group for one in result.comparisons):
        members = [one for one in result.comparisons if one.group == group]
        if all(one.fit is None for one in members):
            continue
        panels = [
            Panel(
                f"{one.name.capitalize()}: {'' if one.fit is None else 'fit '}{fit_in_words(one.fit, ' %')}",
                one.unit,
                [
                    Series("recording", one.time, one.recorded, colour=1),
                    Series("simulation", one.time, one.simulated, colour=2, style="--"),
                ],
            )
            for one in members
        ]
        since = "the simulation's first state, delay removed" if result.removed else "the first state of each"
        pictures[group] = stacked_panels(panels, x_label=f"time since {since} (s)", height=1.6)
    return pictures


def overlay_table(overlays: Mapping[str, Overlay]) -> tuple[list[str], list[list[object]], str]:
    """Return header, rows and caption of all fits."""
    header = ["run", "delay (s)", "signal", "fit (%)"]
    rows: list[list[object]] = [
        [
            label,
            f"{one.delay:.3f}",
            f"{entry.group}, {entry.name}",
            fit_in_words(entry.fit),
        ]
        for label, one in overlays.items()
        for entry in one.comparisons
    ]
    least = ", ".join(f"{value:g} {unit}" for unit, value in SMALLEST_SPREAD.items())
    caption = f"100·(1 − ‖y − ŷ‖/‖y − mean y‖) over the recording; {HARDLY}: by less than {least}"
    return header, rows, caption
