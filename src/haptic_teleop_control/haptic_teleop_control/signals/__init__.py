"""Artificial commands: step, amplitude and frequency sweep, square, triangle, multisine, steps, and
combinations."""

from haptic_teleop_control.signals.generator import SignalGenerator
from haptic_teleop_control.signals.settings import (
    AmplitudeSweep,
    FrequencySweep,
    Multisine,
    SignalSettings,
    Square,
    Step,
    Steps,
    Triangle,
)
from haptic_teleop_control.signals.table import mapping_from, settings_from, signal_parameters, signal_table

__all__ = [
    "AmplitudeSweep",
    "FrequencySweep",
    "Multisine",
    "SignalGenerator",
    "SignalSettings",
    "Square",
    "Step",
    "Steps",
    "Triangle",
    "mapping_from",
    "settings_from",
    "signal_parameters",
    "signal_table",
]
