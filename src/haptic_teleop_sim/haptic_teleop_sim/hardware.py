"""The simulated robots: plants and the hardware around them, as the drivers would see it."""

from .joint_hardware import JointHardware
from .omni_robot import OMNI_PARAMETERS, OmniRobot, OmniSettings, axis_hardware
from .sfj_robot import SFJ_PARAMETERS, SfjRobot, SfjSettings, stage_hardware
from .step_result import StepResult

__all__ = [
    "OMNI_PARAMETERS",
    "SFJ_PARAMETERS",
    "JointHardware",
    "OmniRobot",
    "OmniSettings",
    "SfjRobot",
    "SfjSettings",
    "StepResult",
    "axis_hardware",
    "stage_hardware",
]
