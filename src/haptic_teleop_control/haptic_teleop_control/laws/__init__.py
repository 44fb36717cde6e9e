"""Force laws by name, and the master's side of the teleoperation."""

from haptic_teleop_control.laws.augmented_error import AugmentedErrorGains, AugmentedErrorLaw
from haptic_teleop_control.laws.contract import ForceLaw, LawResult
from haptic_teleop_control.laws.disturbance_observer import (
    DisturbanceObserverLaw,
    DisturbanceObserverSettings,
)
from haptic_teleop_control.laws.master_side import MasterSettings, MasterSide
from haptic_teleop_control.laws.stage_law import StageLaw

LAWS: dict[str, type[ForceLaw]] = {
    "augmented_error": AugmentedErrorLaw,
    "disturbance_observer": DisturbanceObserverLaw,
}
"""Force laws by the name that the controller's parameter `law` takes."""

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
]
