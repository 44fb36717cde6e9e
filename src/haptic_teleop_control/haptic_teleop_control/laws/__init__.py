"""Force laws by name, and the master's side of the teleoperation."""

from collections.abc import Mapping, Sequence
from typing import Any

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.laws.augmented_error import AugmentedErrorGains, AugmentedErrorLaw
from haptic_teleop_control.laws.contract import ForceLaw, LawResult
from haptic_teleop_control.laws.disturbance_observer import DisturbanceObserverLaw
from haptic_teleop_control.laws.master_side import MasterSettings, MasterSide
from haptic_teleop_control.laws.observer_settings import DisturbanceObserverSettings
from haptic_teleop_control.laws.stage_law import StageLaw
from haptic_teleop_control.parameters import Parameter
from haptic_teleop_control.plugins import load_object

LAWS: dict[str, type[ForceLaw]] = {
    "augmented_error": AugmentedErrorLaw,
    "disturbance_observer": DisturbanceObserverLaw,
}
"""Force laws by the name that the controller's parameter `law` takes."""


def comes_with_the_project(name: str) -> bool:
    """Whether `name` is a law of LAWS, by its name there or by its own "module:object".

    Decided without importing anything: what a recording or another file of somebody else's names may be
    asked here before it is loaded.
    """
    return name in LAWS or name in {f"{law.__module__}:{law.__qualname__}" for law in LAWS.values()}


def find_law(name: str) -> type[ForceLaw]:
    """The law of LAWS by its name, or one of the user's own by "module:object".

    Raises ConfigurationError for an unknown name, and for an object that is no ForceLaw or lacks a part of
    one.
    """
    if ":" not in name:
        if name in LAWS:
            return LAWS[name]
        raise ConfigurationError(f"law is {name!r}; choose {', '.join(LAWS)}, or write module:object.")
    law = load_object(name, "law")
    if not (isinstance(law, type) and issubclass(law, ForceLaw)):
        raise ConfigurationError(
            f"law is {name!r}, which is no ForceLaw; derive it from StageLaw or ForceLaw."
        )
    lacking = sorted(getattr(law, "__abstractmethods__", ()))
    if lacking:
        raise ConfigurationError(f"law is {name!r}, which does not define {', '.join(lacking)}; write it.")
    return law


def parameters_of_own_law(stated: Mapping[str, Any], stages: Sequence[str]) -> list[Parameter]:
    """The parameters of a law of the user's own, where `stated` names one as `law`; else none.

    Raises ConfigurationError as `find_law`.
    """
    name = stated.get("law")
    return find_law(name).parameters(stages) if isinstance(name, str) and ":" in name else []


__all__ = [
    "LAWS",
    "AugmentedErrorGains",
    "AugmentedErrorLaw",
    "DisturbanceObserverLaw",
    "DisturbanceObserverSettings",
    "ForceLaw",
    "LawResult",
    "MasterSettings",
    "MasterSide",
    "StageLaw",
    "comes_with_the_project",
    "find_law",
    "parameters_of_own_law",
]
