"""The hardware between one joint and the messages: amplifier before it, encoders and current sense behind it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from haptic_teleop_control.quantities import check_quantities, quantity

from .model import Model


@dataclass(frozen=True)
class JointHardware:
    """One joint with its hardware; a resolution of 0 is none.

    model: the plant, a model of this joint (see `Model`). Raises ConfigurationError naming the field for a
    value outside its range.
    """

    model: Model
    torque_constant: float = quantity(1.0, "N·m/A", "nominal effort per command, of the messages", above=0.0)
    command_limit: float = quantity(
        math.inf,
        "A",
        "largest current that the amplifier gives",
        name="current_limit",
        above=0.0,
        infinite=True,
    )
    command_resolution: float = quantity(
        0.0, "A", "per step of the analog output; 0: none", name="amplifier.resolution", minimum=0.0
    )
    drive_resolution: float = quantity(0.0, "rad", "per count of the drive's encoder; 0: none", minimum=0.0)
    joint_resolution: float = quantity(0.0, "rad", "per count of the joint's encoder; 0: none", minimum=0.0)
    sense_offset: float = quantity(0.0, "A", "error of the measured current", name="current_sense.offset")
    sense_noise: float = quantity(
        0.0, "A", "standard deviation of the measured current", name="current_sense.noise", minimum=0.0
    )
    sense_resolution: float = quantity(
        0.0, "A", "per step of the analog input; 0: none", name="current_sense.resolution", minimum=0.0
    )
    stiffness: float = quantity(1.0, "N·m/rad", "nominal stiffness, for the effort of the arm", above=0.0)
    disturbance_rms: float = quantity(
        0.0, "N·m", "random torque at the motor, root mean square", name="disturbance.rms", minimum=0.0
    )
    disturbance_cutoff_hz: float = quantity(
        5.0, "Hz", "bandwidth of that torque (first order)", name="disturbance.cutoff_hz", above=0.0
    )
    initial_angle: float = quantity(0.0, "rad", "angle at the start", minimum=-1.6, maximum=1.6)

    def __post_init__(self) -> None:
        check_quantities(self)

    def row(self, dt: float) -> tuple[float, ...]:
        """The row of `hw` in `kernel/stepping.py`, for samples every `dt` s."""
        # First-order colour: x <- memory x + gain w keeps the root mean square whatever dt is.
        memory = math.exp(-2.0 * math.pi * self.disturbance_cutoff_hz * dt)
        gain = self.disturbance_rms * math.sqrt(1.0 - memory * memory)
        return (
            self.torque_constant,
            self.command_limit,
            self.command_resolution,
            self.drive_resolution,
            self.joint_resolution,
            self.sense_offset,
            self.sense_noise,
            self.sense_resolution,
            self.stiffness,
            memory,
            gain,
        )
