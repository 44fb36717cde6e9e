"""The simulated robots: plants and the hardware around them, as the drivers would see it."""

from .omni_robot import OMNI_PARAMETERS, OmniAxisSettings, OmniRobot, OmniSettings
from .sfj_robot import SFJ_PARAMETERS, SfjRobot, SfjSettings, StageSettings
from .step_result import StepResult

__all__ = [
    "OMNI_PARAMETERS",
    "SFJ_PARAMETERS",
    "OmniAxisSettings",
    "OmniRobot",
    "OmniSettings",
    "SfjRobot",
    "SfjSettings",
    "StageSettings",
    "StepResult",
]
