"""Signal settings as the parameters of a node, and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.parameters import Parameter, ParameterTable
from haptic_teleop_control.quantities import from_parameters, parameters_of, to_parameters
from haptic_teleop_control.robots import SFJ_RATE_HZ, STAGES
from haptic_teleop_control.signals.settings import COMPONENTS, SignalSettings

KINDS = {"position": "rad", "effort": "N·m"}
"""Kinds of command, with the unit of their amplitudes."""


def signal_parameters(stages: Sequence[str] = STAGES) -> list[Parameter]:
    """`kind`, `rate`, and for each stage `stage1.enabled`, `stage1.step.amplitude` and so on; the stages'
    parameters may change while running."""
    found = [
        Parameter("kind", "position", choices=tuple(KINDS), meaning="what the command is"),
        Parameter("rate", SFJ_RATE_HZ, "Hz", above=0.0, maximum=10_000.0, meaning="samples per second"),
    ]
    settings = SignalSettings()
    for stage in stages:
        found += parameters_of(settings, f"{stage}.")
        for component in COMPONENTS:
            found += parameters_of(getattr(settings, component), f"{stage}.{component}.")
    return found


def signal_table(node_name: str = "signal_generator", stages: Sequence[str] = STAGES) -> ParameterTable:
    """The table of a node that has these parameters only."""
    return ParameterTable(node_name, signal_parameters(stages))


def settings_from(
    mapping: Mapping[str, Any], stages: Sequence[str] = STAGES, source: str = "parameters"
) -> dict[str, SignalSettings]:
    """Settings of each stage from flat parameters; what is not stated keeps its default.

    `mapping` may hold other parameters of the same node only under names that do not begin with a stage's
    name. Raises ConfigurationError naming `source`, key and remedy: unknown key, type, range, components that
    contradict each other, a frequency that `rate` cannot carry.
    """
    table = signal_table(stages=stages)
    own = {
        key: value for key, value in mapping.items() if key in ("kind", "rate") or key.split(".")[0] in stages
    }
    values = table.check(own, source)
    settings = {}
    for stage in stages:
        try:
            components = {
                name: from_parameters(type(getattr(SignalSettings(), name)), values, f"{stage}.{name}.")
                for name in COMPONENTS
            }
            settings[stage] = from_parameters(SignalSettings, values, f"{stage}.", **components)
            settings[stage].check_rate(values["rate"])
        except ConfigurationError as error:
            raise ConfigurationError(f"{source}: {stage}.{error}") from error
    return settings


def mapping_from(settings: Mapping[str, SignalSettings]) -> dict[str, Any]:
    """Flat parameters of all stages, the reverse of `settings_from`."""
    mapping: dict[str, Any] = {}
    for stage, signal in settings.items():
        mapping |= to_parameters(signal, f"{stage}.")
        for component in COMPONENTS:
            mapping |= to_parameters(getattr(signal, component), f"{stage}.{component}.")
    return mapping
