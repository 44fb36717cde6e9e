"""Force laws by name, and the master's side of the teleoperation."""

from haptic_teleop_control.laws.augmented_error import AugmentedErrorGains, AugmentedErrorLaw
from haptic_teleop_control.laws.contract import ForceLaw, LawResult
from haptic_teleop_control.laws.master_side import MasterSettings, MasterSide

LAWS: dict[str, type[ForceLaw]] = {"augmented_error": AugmentedErrorLaw}
"""Force laws by the name that the controller's parameter `law` takes."""

__all__ = [
    "LAWS",
    "AugmentedErrorGains",
    "AugmentedErrorLaw",
    "ForceLaw",
    "LawResult",
    "MasterSettings",
    "MasterSide",
]
