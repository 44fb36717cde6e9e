"""What one stage of the robot may do, each a ROS parameter: constants, limits, corrections."""

from __future__ import annotations

from dataclasses import dataclass

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.quantities import check_quantities, quantity
from haptic_teleop_control.robots import SFJ_STAGES

CURRENT_SLEW = 50.0
"""A/s. At 500 Hz one sample changes the current by 0.1 A at most, which is where the thesis (3.1.1) begins to
ask for care. Zero to 0.5 A takes 10 ms: a tenth of the period of the fastest mode (5.4 Hz), so that a force
loop does not notice; a command that jumps to and fro at every sample is cut to that tenth of an ampere."""


@dataclass(frozen=True)
class StageSettings:
    """One stage. Raises ConfigurationError naming the field for a value outside its range."""

    torque_constant: float = quantity(1.0, "N·m/A", "nominal effort per current, of the messages", above=0.0)
    stiffness: float = quantity(1.0, "N·m/rad", "nominal stiffness, for the effort of the arm", above=0.0)
    current_limit: float = quantity(
        0.5, "A", "largest current; default: recommended, most: the motor's maximum", above=0.0
    )
    continuous_current: float = quantity(
        0.5, "A", "recommended current, which may flow for ever", name="i2t.continuous", above=0.0
    )
    overload_time: float = quantity(
        5.0, "s", "time for which current_limit may flow from cold", name="i2t.time", above=0.0, maximum=60.0
    )
    current_slew: float = quantity(
        CURRENT_SLEW, "A/s", "largest rate of the current; .inf: none", above=0.0, infinite=True
    )
    drift_correction: float = quantity(
        0.0, "A", "added to every command, against a drift in one direction", minimum=-0.2, maximum=0.2
    )
    sense_offset: float = quantity(
        0.0,
        "A",
        "subtracted from the measured current",
        name="current_sense.correction",
        minimum=-0.2,
        maximum=0.2,
    )
    drive_sign: int = quantity(
        1, "", "of the drive's encoder: 1 or -1", name="drive_encoder.sign", choices=(-1, 1)
    )
    joint_sign: int = quantity(
        1, "", "of the joint's encoder: 1 or -1 (assumed)", name="joint_encoder.sign", choices=(-1, 1)
    )
    gear_ratio: float = quantity(100.0, "", "turns of the motor per turn of the drive's output", above=0.0)
    deflection_trip: float = quantity(
        0.35, "rad", "difference of both encoders at which the driver stops", above=0.0, maximum=1.0
    )

    def __post_init__(self) -> None:
        check_quantities(self)
        if self.continuous_current > self.current_limit:
            object.__setattr__(self, "continuous_current", self.current_limit)

    @classmethod
    def nominal(cls, stage: str, **changes: float) -> StageSettings:
        """The facts of `stage` ("stage1" or "stage2"), and `changes` to them."""
        facts = SFJ_STAGES[stage]
        values = {
            "torque_constant": facts.torque_constant,
            "stiffness": facts.stiffness,
            "current_limit": facts.recommended_current,
            "continuous_current": facts.recommended_current,
            "gear_ratio": facts.gear_ratio,
        }
        return cls(**{**values, **changes})  # type: ignore[arg-type]


def check_hardware_maximum(stage: str, settings: StageSettings) -> None:
    """Raises ConfigurationError when the limit of `stage` is above what its motor carries."""
    maximum = SFJ_STAGES[stage].current_limit
    if settings.current_limit > maximum:
        raise ConfigurationError(
            f"{stage}.current_limit is {settings.current_limit:g} A, above the motor's {maximum:g} A; lower"
            f" it."
        )
