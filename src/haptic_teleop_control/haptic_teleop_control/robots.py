"""The two robots in numbers: names, order and pairing of the joints, and what the hardware can do.

Every node, plant and tool takes these numbers from here. They are defaults of parameters, never hidden
constants: each can be overridden by the configuration. SI units; counter-clockwise is positive.

Sources: gear ratios 100 and 80, joint encoder gearing 6.23, measured spring stiffness and the current limits
are stated by the thesis (sections 2.4.1 to 2.4.4); motor constants, drive efficiency, rates and the velocity
filter come from Quanser's configuration of the sibling robot 2DSFL. Values marked *assumed* were found in no
source.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

SFJ_JOINTS = ("stage1_motor", "stage1_arm", "stage2_motor", "stage2_arm")
"""Joints of the Quanser 2DSFJ, in the order of every message and recording."""

SFJ_MOTOR_JOINTS = ("stage1_motor", "stage2_motor")
"""The joints of the 2DSFJ that take an effort command."""

OMNI_JOINTS = ("omni_x", "omni_y", "omni_z")
"""Joints of the Phantom Omni, angles about the neutral position."""

STAGES = ("stage1", "stage2")
"""The stages of the 2DSFJ: shoulder and elbow."""

PAIRS = {"stage1": "omni_y", "stage2": "omni_z"}
"""Which axis of the Omni commands, or is commanded by, which stage (thesis 2.2)."""

SFJ_RATE_HZ = 500.0
"""Sampling rate of the 2DSFJ."""

OMNI_RATE_HZ = 1000.0
"""Sampling rate of the Omni's servo loop."""

VELOCITY_FILTER_CUTOFF_HZ = 40.0
VELOCITY_FILTER_DAMPING = 0.9

ENCODER_COUNTS_PER_TURN = 4096
"""Counts per turn of every encoder of the 2DSFJ, four-fold evaluation included (1024 lines)."""

JOINT_ENCODER_GEARING = 6.23
"""Turns of a joint encoder per turn of the joint."""


@dataclass(frozen=True)
class StageFacts:
    """One stage of the 2DSFJ.

    torque_constant: N·m/A at the drive's output, nominal; current x torque_constant is the effort in every
    message.
    stiffness: N·m/rad of the joint with the lightest springs in the outer holes, measured.
    current_limit: A, what the amplifier is allowed at most. recommended_current: A, what open loop tests
    should keep.
    gear_ratio: turns of the motor per turn of the output.
    drive_resolution, joint_resolution: rad at the output per count of the drive and the joint encoder.
    """

    torque_constant: float
    stiffness: float
    current_limit: float
    recommended_current: float
    gear_ratio: float
    drive_resolution: float
    joint_resolution: float

    @property
    def torque_limit(self) -> float:
        """Nominal effort at the current limit, N·m."""
        return self.current_limit * self.torque_constant


def _stage(torque_constant: float, stiffness: float, current_limit: float, gear_ratio: float) -> StageFacts:
    turn = 2.0 * math.pi / ENCODER_COUNTS_PER_TURN
    return StageFacts(
        torque_constant=torque_constant,
        stiffness=stiffness,
        current_limit=current_limit,
        recommended_current=0.5,
        gear_ratio=gear_ratio,
        drive_resolution=turn / gear_ratio,
        joint_resolution=turn / JOINT_ENCODER_GEARING,
    )


SFJ_STAGES: dict[str, StageFacts] = {
    "stage1": _stage(torque_constant=8.925, stiffness=3.971, current_limit=0.94, gear_ratio=100.0),
    "stage2": _stage(torque_constant=1.392, stiffness=3.891, current_limit=1.2, gear_ratio=80.0),
}
"""Facts of both stages. The torque constants are efficiency x motor constant x gear ratio: 0.75 x 0.119 x 100
and 0.75 x 0.0232 x 80."""


@dataclass(frozen=True)
class OmniAxisFacts:
    """One axis of the Omni, about its neutral position.

    lower, upper: rad, the mechanical range. Y moves over 2 to 102 degrees and Z over 105 degrees (thesis
    2.3.3); that the neutral position is the middle of the range is *assumed*.
    inertia: kg·m², from published models of the device; None where none was found.
    spring_stiffness: N·m/rad of the device's internal spring. spring_rest: rad, where that spring is relaxed.
    """

    lower: float
    upper: float
    inertia: float | None
    spring_stiffness: float = 0.0
    spring_rest: float = 0.0

    @property
    def range(self) -> float:
        """Width of the mechanical range, rad."""
        return self.upper - self.lower


OMNI_AXES: dict[str, OmniAxisFacts] = {
    "omni_x": OmniAxisFacts(lower=-0.98, upper=0.98, inertia=None),
    "omni_y": OmniAxisFacts(
        lower=math.radians(-50.0),
        upper=math.radians(50.0),
        inertia=2.526e-3,
        spring_stiffness=0.1173,
        spring_rest=math.radians(
            90.0 - 52.0
        ),  # relaxed at 90 degrees absolute, neutral at the middle of 2..102
    ),
    "omni_z": OmniAxisFacts(lower=math.radians(-52.5), upper=math.radians(52.5), inertia=6.52e-4),
}

OMNI_PEAK_TORQUE = 0.446
"""N·m, from 3.3 N peak force at the end of a 0.135 m link."""

OMNI_CONTINUOUS_TORQUE = 0.119
"""N·m, from 0.88 N continuous force at the end of a 0.135 m link."""

OMNI_RESOLUTION = 4.1e-4
"""rad, from 0.055 mm at the end of a 0.135 m link."""
