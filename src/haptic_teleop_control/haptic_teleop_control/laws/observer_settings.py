"""Settings of the law with observers (`disturbance_observer`): what a stage is and how it shall be driven."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.quantities import check_quantities, quantity
from haptic_teleop_control.robots import SFJ_STAGES


@dataclass(frozen=True)
class DisturbanceObserverSettings:
    """One stage. Raises ConfigurationError naming the field for a value outside its range."""

    lambda_: float = quantity(
        unit="N·m·s/rad",
        meaning="velocity penalty; speed in free motion is Td/lambda",
        name="lambda",
        above=0.0,
    )
    motor_rate: float = quantity(
        unit="1/s", meaning="how fast the drive takes up a velocity", name="observer.motor_rate", above=0.0
    )
    disturbance_rate: float = quantity(
        unit="1/s",
        meaning="bandwidth of the observer of the drive's disturbance",
        name="observer.disturbance_rate",
        above=0.0,
    )
    contact_rate: float = quantity(
        unit="1/s",
        meaning="how fast the joint's torque follows against an environment",
        name="observer.contact_rate",
        above=0.0,
    )
    contact_sense: float = quantity(
        unit="s",
        meaning="time constant of the momentum observer of the environment's torque",
        name="observer.contact_sense",
        above=0.0,
    )
    contact_memory: float = quantity(
        unit="s",
        meaning="time constant with which the caution after an impact decays",
        name="observer.contact_memory",
        above=0.0,
    )
    contact_share: float = quantity(
        meaning="contact is where the observed torque exceeds this share of Td; above the model's errors",
        name="observer.contact_share",
        above=0.0,
        maximum=1.0,
    )
    impact_share: float = quantity(
        meaning="an impact is where the observed torque exceeds this multiple of Td; at rest it is 1 at most",
        name="observer.impact_share",
        minimum=1.0,
    )
    smallest_torque: float = quantity(
        unit="N·m",
        meaning="smallest Td to which the shares refer",
        name="observer.smallest_torque",
        above=0.0,
    )
    caution: float = quantity(
        meaning="share by which Td is reduced after an impact until contact is regained",
        name="observer.caution",
        minimum=0.0,
        maximum=1.0,
    )
    rebound_damping: float = quantity(
        unit="N·m·s/rad",
        meaning="additional damping of the arm after an impact, beside lambda",
        name="observer.rebound_damping",
        minimum=0.0,
    )
    motor_inertia: float = quantity(
        unit="kg·m²", meaning="J1 of the model", name="observer.motor_inertia", above=0.0
    )
    motor_damping: float = quantity(
        unit="N·m·s/rad", meaning="B1 of the model", name="observer.motor_damping", minimum=0.0
    )
    arm_inertia: float = quantity(
        unit="kg·m²", meaning="J2 of the model", name="observer.arm_inertia", above=0.0
    )
    arm_damping: float = quantity(
        unit="N·m·s/rad",
        meaning="B2 of the model; less than lambda",
        name="observer.arm_damping",
        minimum=0.0,
    )
    stiffness: float = quantity(unit="N·m/rad", meaning="stiffness Ks of the elastic joint", above=0.0)
    torque_constant: float = quantity(unit="N·m/A", meaning="effort per current in messages", above=0.0)
    current_limit: float = quantity(unit="A", meaning="largest current commanded", above=0.0)

    def __post_init__(self) -> None:
        check_quantities(self)
        if self.arm_damping >= self.lambda_:
            raise ConfigurationError(
                f"observer.arm_damping is {self.arm_damping:g} N·m·s/rad; choose one below lambda, "
                f"{self.lambda_:g}."
            )

    @classmethod
    def for_stage(cls, stage: str, **changes: float) -> DisturbanceObserverSettings:
        """Settings of `stage` (a key of SFJ_STAGES) with the nominal joint, and `changes` to them.

        The model is that of config/models; the rates and times were found in simulation (docs/contact.md).
        Raises ConfigurationError for another stage.
        """
        if stage not in SFJ_STAGES:
            raise ConfigurationError(f"stage {stage} is unknown; choose one of {', '.join(SFJ_STAGES)}.")
        facts = SFJ_STAGES[stage]
        own = _TUNED[stage] | {
            "lambda_": 0.5,
            "stiffness": facts.stiffness,
            "torque_constant": facts.torque_constant,
            "current_limit": facts.current_limit,
        }
        return replace(cls(**own), **changes)


_TUNED: dict[str, dict[str, Any]] = {
    "stage1": {
        "motor_rate": 140.0,
        "disturbance_rate": 250.0,
        "contact_rate": 28.0,
        "contact_sense": 0.02,
        "contact_memory": 0.6,
        "contact_share": 0.3,
        "impact_share": 1.4,
        "smallest_torque": 0.1,
        "caution": 0.72,
        "rebound_damping": 1.3,
        "motor_inertia": 0.0635,
        "motor_damping": 2.6,
        "arm_inertia": 0.17,
        "arm_damping": 0.02,
    },
    # The light arm is back at the wall before the drive could spare it anything: no caution.
    "stage2": {
        "motor_rate": 140.0,
        "disturbance_rate": 250.0,
        "contact_rate": 25.0,
        "contact_sense": 0.0045,
        "contact_memory": 0.02,
        "contact_share": 0.2,
        "impact_share": 1.5,
        "smallest_torque": 0.1,
        "caution": 0.0,
        "rebound_damping": 0.0,
        "motor_inertia": 0.00704,
        "motor_damping": 0.6,
        "arm_inertia": 0.0064,
        "arm_damping": 0.005,
    },
}
