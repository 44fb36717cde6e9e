"""A force law with observers at both ends of the joint: the drive goes where the augmented error asks, at
once, and the environment is told apart from the arm's own inertia.

The reference law (`augmented_error`) leaves the augmented error s (27) to a PI controller that must also find
the friction of the drive. Here the drive is a velocity source, and s = 0 is solved for the velocity:

    w     disturbance torque at the drive (friction, wrong model), by an observer of third order on
          J1 th1'' = Ktg I - Te - B1 th1' + w
    Ktg I = J1 kv (v - th1') + B1 th1' + Te - w         so th1' follows v with the rate kv
    v     = th2' + g / Ks (Tr - Te)                     so Te follows Tr with the rate g
    Tr    = Td - (lambda - B2) th2'                     so s = 0; the arm's own damping is no environment

With g = Ks / lambda the last two lines are v = (Td - Te + B2 th2') / lambda: s = 0, as the thesis has it, in
free motion. Against an environment the joint can be loaded faster without moving the arm, and there g is
`contact_rate`. What tells the two apart is the arm's momentum: observers with the time constants T1
(`contact_sense`) and T2 (`contact_memory`),

    r_i   = (y_i - J2 th2') / T_i,   y_i' = Te - B2 th2' - r_i,

give the torque of the environment on the arm, low-passed, however the arm accelerates. Nothing is switched:
m = S(r_2 / Td) moves g from the one to the other, and

    c     = S((r_2 - r_1) / Td)         there was an environment, and now there is none: the arm has bounced
    Tr    = (1 - caution c) Td - (lambda - B2 + rebound_damping c) th2'

lets a bounced arm come back slowly, so that it does not bounce again. S rises smoothly from 0 to 1 between
`threshold` and one and a half of it. While m is near 1, Tr lies between 0 and Td: an arm that flies back is
braked with no more torque than is asked for at the wall, which is what keeps the torque from overshooting.

After momentum-based collision detection (De Luca et al. 2006) and torque control of series elastic joints
(Pratt and Williamson 1995), with the thesis' augmented error as the wanted behaviour.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.filters import velocity_coefficients, velocity_step
from haptic_teleop_control.laws.contract import Array
from haptic_teleop_control.laws.stage_law import StageLaw
from haptic_teleop_control.quantities import check_quantities, quantity
from haptic_teleop_control.robots import (
    SFJ_STAGES,
    VELOCITY_FILTER_CUTOFF_HZ,
    VELOCITY_FILTER_DAMPING,
)


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
        unit="s", meaning="time in which a lost contact is noticed", name="observer.contact_sense", above=0.0
    )
    contact_memory: float = quantity(
        unit="s", meaning="time for which a contact is remembered", name="observer.contact_memory", above=0.0
    )
    threshold: float = quantity(
        meaning="share of Td from which an environment counts; keep it above the errors of the model",
        name="observer.threshold",
        above=0.0,
        maximum=1.0,
    )
    smallest_torque: float = quantity(
        unit="N·m",
        meaning="below this Td the threshold is a share of this torque",
        name="observer.smallest_torque",
        above=0.0,
    )
    caution: float = quantity(
        meaning="share of Td that a bounced arm does not get on its way back",
        name="observer.caution",
        minimum=0.0,
        maximum=1.0,
    )
    rebound_damping: float = quantity(
        unit="N·m·s/rad",
        meaning="damping of a bounced arm, beside lambda",
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
        "contact_rate": 39.0,
        "contact_sense": 0.0375,
        "contact_memory": 0.93,
        "threshold": 0.18,
        "smallest_torque": 0.2,
        "caution": 0.57,
        "rebound_damping": 1.65,
        "motor_inertia": 0.0635,
        "motor_damping": 2.6,
        "arm_inertia": 0.17,
        "arm_damping": 0.02,
    },
    # The light arm is back at the wall before the drive could spare it anything.
    "stage2": {
        "motor_rate": 140.0,
        "disturbance_rate": 250.0,
        "contact_rate": 56.0,
        "contact_sense": 0.0045,
        "contact_memory": 0.0055,
        "threshold": 0.15,
        "smallest_torque": 0.12,
        "caution": 0.0,
        "rebound_damping": 0.0,
        "motor_inertia": 0.00704,
        "motor_damping": 0.6,
        "arm_inertia": 0.0064,
        "arm_damping": 0.005,
    },
}

# What a stage remembers.
_STARTED, _FILTER, _ANGLE, _SPEED, _DISTURBANCE, _APPLIED, _TORQUE, _SMOOTH, _FAST, _SLOW = (
    0, slice(1, 4), 4, 5, 6, 7, 8, 9, 10, 11,
)  # fmt: skip


class _Constants(NamedTuple):
    """A stage's settings, and what follows from them and dt; named as in DisturbanceObserverSettings."""

    lambda_: float
    motor_rate: float
    contact_rate: float
    contact_sense: float
    contact_memory: float
    threshold: float
    smallest_torque: float
    caution: float
    rebound_damping: float
    motor_inertia: float
    motor_damping: float
    arm_inertia: float
    arm_damping: float
    stiffness: float
    torque_constant: float
    current_limit: float
    angle_gain: float
    speed_gain: float
    acceleration_gain: float
    smoothing: float
    velocity_filter: Array


class DisturbanceObserverLaw(StageLaw):
    """The law for n stages. It takes the motor's velocity only to start from: it observes both velocities
    itself, because those of the robot come too late for the drive's rate."""

    SETTINGS = DisturbanceObserverSettings
    MEMORY = 12

    @classmethod
    def constants(cls, settings: DisturbanceObserverSettings, dt: float) -> _Constants:
        # Three equal poles of the observer, as gains on the angle's error.
        p = math.exp(-settings.disturbance_rate * dt)
        named = {name: getattr(settings, name) for name in _Constants._fields if hasattr(settings, name)}
        return _Constants(
            **named,
            angle_gain=1.0 - p**3,
            speed_gain=1.5 * (1.0 - p) ** 2 * (1.0 + p) / dt,
            acceleration_gain=(1.0 - p) ** 3 / dt**2,
            smoothing=1.0 - math.exp(-dt / settings.contact_sense),
            velocity_filter=velocity_coefficients(dt, VELOCITY_FILTER_CUTOFF_HZ, VELOCITY_FILTER_DAMPING),
        )

    def carry_over(
        self, memory: Array, old: DisturbanceObserverSettings, new: DisturbanceObserverSettings
    ) -> None:
        # In steady contact Ktg I = Te - w: the current stays what it is, and r1 = r2 = Te.
        memory[_DISTURBANCE] -= memory[_APPLIED] * (new.torque_constant - old.torque_constant)
        memory[_FAST] += (new.contact_sense - old.contact_sense) * memory[_TORQUE]
        memory[_SLOW] += (new.contact_memory - old.contact_memory) * memory[_TORQUE]

    @staticmethod
    def current(
        desired: float, motor: float, arm: float, velocity: float, memory: Array, constants: Any, dt: float
    ) -> float:
        return disturbance_observer_current(desired, motor, arm, velocity, memory, constants, dt)


@njit(cache=True)
def _rise(x, threshold):  # type: ignore[no-untyped-def]
    """0 below `threshold`, 1 above one and a half of it, smooth between."""
    x = min(max((x - threshold) / (0.5 * threshold), 0.0), 1.0)
    return x * x * (3.0 - 2.0 * x)


@njit(cache=True)
def disturbance_observer_current(desired, motor, arm, velocity, memory, k, dt):  # type: ignore[no-untyped-def]
    """Current wanted of one stage, A, by the module's equations; see `StageLaw.current`. k: _Constants."""
    torque = k.stiffness * (motor - arm)
    if memory[_STARTED] == 0.0:
        memory[_STARTED] = 1.0
        # As if both had always moved with the motor's velocity, driven as that needs, and touched nothing.
        lag = 2.0 * VELOCITY_FILTER_DAMPING / (2.0 * math.pi * VELOCITY_FILTER_CUTOFF_HZ)
        before = arm - velocity * dt
        memory[1], memory[2], memory[3] = before - lag * velocity, velocity, before
        memory[_ANGLE], memory[_SPEED], memory[_TORQUE] = motor - velocity * dt, velocity, torque
        memory[_APPLIED] = (torque + k.motor_damping * velocity) / k.torque_constant
        memory[_SMOOTH] = velocity
        memory[_FAST] = memory[_SLOW] = k.arm_inertia * velocity

    # The drive: what the last current should have done, and what the encoder says.
    acceleration = (
        k.torque_constant * memory[_APPLIED]
        - memory[_TORQUE]
        - k.motor_damping * memory[_SPEED]
        + memory[_DISTURBANCE]
    ) / k.motor_inertia
    angle = memory[_ANGLE] + dt * memory[_SPEED] + 0.5 * dt * dt * acceleration
    error = motor - angle
    speed = memory[_SPEED] + dt * acceleration + k.speed_gain * error
    disturbance = memory[_DISTURBANCE] + k.motor_inertia * k.acceleration_gain * error
    memory[_ANGLE], memory[_SPEED], memory[_DISTURBANCE] = angle + k.angle_gain * error, speed, disturbance

    # The arm: its velocity, and the environment's torque, fast and slow.
    filtered = memory[_FILTER].reshape((1, 3))
    arm_speed = velocity_step(np.array([arm]), filtered, k.velocity_filter)[0]
    memory[_SMOOTH] += k.smoothing * (arm_speed - memory[_SMOOTH])
    momentum = k.arm_inertia * memory[_SMOOTH]
    fast = (memory[_FAST] - momentum) / k.contact_sense
    slow = (memory[_SLOW] - momentum) / k.contact_memory
    load = torque - k.arm_damping * arm_speed
    # A time constant below dt would let the observer ring: it then forgets all within one sample.
    memory[_FAST] += min(dt, k.contact_sense) * (load - fast)
    memory[_SLOW] += min(dt, k.contact_memory) * (load - slow)
    side = math.copysign(1.0, desired)
    # Without a command nothing is pressed against, whatever is remembered.
    scale = 0.0 if desired == 0.0 else side / max(abs(desired), k.smallest_torque)
    # Torque against the command is no contact of this command; a wrong arm inertia feigns it, too.
    slow, fast = max(scale * slow, 0.0), max(scale * fast, 0.0)
    contact = _rise(slow, k.threshold)
    bounced = _rise(slow - fast, k.threshold)

    # What the joint shall hold, the velocity that gets it there, the current that gives the velocity.
    damping = k.lambda_ - k.arm_damping + k.rebound_damping * bounced
    wanted = side * ((1.0 - k.caution * bounced) * desired - damping * arm_speed)
    inside = min(max(wanted, 0.0), abs(desired))
    wanted = inside + (1.0 - contact) * (wanted - inside)
    rate = k.stiffness / k.lambda_
    rate += contact * max(k.contact_rate - rate, 0.0)
    target = arm_speed + rate / k.stiffness * (side * wanted - torque)
    drive = k.motor_inertia * k.motor_rate * (target - speed) + k.motor_damping * speed
    current = (drive + torque - disturbance) / k.torque_constant
    memory[_APPLIED] = min(max(current, -k.current_limit), k.current_limit)
    memory[_TORQUE] = torque
    return current
