"""Pictures of recordings before anything is estimated: their signals, and the spectrum of an excitation."""

from __future__ import annotations

import numpy as np

from haptic_teleop_control.recording import JointStateSeries
from haptic_teleop_sysid.estimation.excitation import Excitation
from haptic_teleop_sysid.recordings.recorded_parameters import recorded_units
from haptic_teleop_sysid.report import Panel, Plot, Series, unit_text
from haptic_teleop_sysid.runs.comparison_pictures import input_panel
from haptic_teleop_sysid.runs.dataset_look import Look

SIGNALS_DRAWN = 12
"""Signals of a recording that a picture without a model shows."""


def signals_picture(one: Look) -> Plot:
    """Return the data set's input and outputs over time, s; without a model the signals of the recording's
    topics, SIGNALS_DRAWN at most."""
    if one.dataset is not None:
        d = one.dataset
        panels = [input_panel(d)]
        panels += [Panel(n, d.units()[n], [Series("measured", d.time, v)]) for n, v in d.signals().items()]
        return Plot(panels, "time since the recording's first sample (s)")
    panels = []
    for topic, series in one.recording.topics.items():
        for joint in series.names:
            units = recorded_units(one.recording.experiment, joint)
            for field, unit in (("position", units["position"]), ("effort", units["input"])):
                if len(panels) < SIGNALS_DRAWN and _holds(series, joint, field):
                    line = Series("", series.time(), series.signal(joint, field))
                    panels.append(Panel(f"{topic} {joint}.{field}", unit_text(unit), [line]))
    return Plot(panels)


def spectrum_picture(one: Excitation, unit: str) -> Plot:
    """Return the power densities, dB, of input (in ``unit``) and motor speed over frequency, Hz, up to a
    quarter of the sampling rate."""
    inside = (one.frequency > 0.0) & (one.frequency < 0.5 * one.frequency[-1])
    panels = []
    for title, power in (
        (f"input, dB re 1 {_squared(unit)}/Hz", one.input_spectrum),
        ("motor speed, dB re 1 (rad/s)²/Hz", one.response_spectrum),
    ):
        decibels = 10.0 * np.log10(np.maximum(power[inside], 1e-30))
        line = Series("", np.asarray(one.frequency[inside]), np.asarray(decibels))
        panels.append(Panel(title, "dB", [line], spans=[one.band]))
    return Plot(panels, "frequency (Hz); shaded: 95 % of the input's power")


def _holds(series: JointStateSeries, joint: str, field: str) -> bool:
    return getattr(series, field) is not None and bool(np.any(np.isfinite(series.signal(joint, field))))


def _squared(unit: str) -> str:
    """The square of a unit: that of a product in parentheses."""
    text = unit_text(unit) or "1"
    return f"{text}²" if text.isalpha() else f"({text})²"
