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
`contact_rate`. What tells the two apart is the arm's momentum, however the arm accelerates:

    r     torque of the arm on its environment: r = (y - J2 th2') / T1, y' = Te - B2 th2' - r
    q     memory of an impact: 1 where r exceeds `impact_share` Td, which at rest it never does; fades with T2
    m     contact: r above `contact_share` Td, or an impact remembered; g = Ks/lambda + m (contact_rate - ...)
    c     bounced: an impact is remembered and the arm has left the wall since; fades with q
    Tr    = (1 - caution c) Td - (lambda - B2 + rebound_damping c) th2'

Nothing is switched: each is a smooth function between 0 and 1. While m is near 1, Tr is never above Td: an
arm that flies back is braked with no more torque than is asked for at the wall, which is what keeps the
torque from overshooting. c lets a bounced arm come back slowly, so that it hardly bounces again; the torque
then rises to Td as the memory fades.

After momentum-based collision detection (De Luca et al. 2006) and torque control of series elastic joints
(Pratt and Williamson 1995), with the thesis' augmented error as the wanted behaviour.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from haptic_teleop_control.compiled import njit
from haptic_teleop_control.filters import velocity_coefficients, velocity_step
from haptic_teleop_control.laws.contract import Array
from haptic_teleop_control.laws.observer_settings import DisturbanceObserverSettings
from haptic_teleop_control.laws.stage_law import StageLaw
from haptic_teleop_control.robots import VELOCITY_FILTER_CUTOFF_HZ, VELOCITY_FILTER_DAMPING

FORGOTTEN = 0.3
"""What is left of the memory of an impact when it no longer counts."""

# What a stage remembers.
_STARTED, _FILTER, _ANGLE, _SPEED, _DISTURBANCE, _APPLIED, _TORQUE, _SMOOTH, _MOMENTUM, _IMPACT, _BOUNCE = (
    0, slice(1, 4), 4, 5, 6, 7, 8, 9, 10, 11, 12,
)  # fmt: skip


class _Constants(NamedTuple):
    """A stage's settings, and what follows from them and dt; named as in DisturbanceObserverSettings."""

    lambda_: float
    motor_rate: float
    contact_rate: float
    contact_sense: float
    contact_memory: float
    contact_share: float
    impact_share: float
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
    forgetting: float
    velocity_filter: Array


class DisturbanceObserverLaw(StageLaw):
    """The law for n stages. It takes the motor's velocity only to start from: it observes both velocities
    itself, because those of the robot come too late for the drive's rate."""

    SETTINGS = DisturbanceObserverSettings
    MEMORY = 13

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
            forgetting=math.exp(-dt / settings.contact_memory),
            velocity_filter=velocity_coefficients(dt, VELOCITY_FILTER_CUTOFF_HZ, VELOCITY_FILTER_DAMPING),
        )

    def carry_over(
        self, memory: Array, old: DisturbanceObserverSettings, new: DisturbanceObserverSettings
    ) -> None:
        # In steady contact Ktg I = Te - w: the current stays what it is, and r = Te.
        memory[_DISTURBANCE] -= memory[_APPLIED] * (new.torque_constant - old.torque_constant)
        memory[_MOMENTUM] += (new.contact_sense - old.contact_sense) * memory[_TORQUE]

    @staticmethod
    def current(
        desired: float, motor: float, arm: float, velocity: float, memory: Array, constants: Any, dt: float
    ) -> float:
        return disturbance_observer_current(desired, motor, arm, velocity, memory, constants, dt)


@njit(cache=True)
def _rise(x, threshold):  # type: ignore[no-untyped-def]
    """0 below `threshold`, 1 above one and a half of it, smooth between. x, threshold: shares of Td, or of a
    whole memory."""
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
        memory[_MOMENTUM] = k.arm_inertia * velocity

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

    # The arm: its velocity, and what its momentum says of the environment.
    filtered = memory[_FILTER].reshape((1, 3))
    arm_speed = velocity_step(np.array([arm]), filtered, k.velocity_filter)[0]
    memory[_SMOOTH] += k.smoothing * (arm_speed - memory[_SMOOTH])
    environment = (memory[_MOMENTUM] - k.arm_inertia * memory[_SMOOTH]) / k.contact_sense
    # A time constant below dt would let the observer ring: it then forgets all within one sample.
    memory[_MOMENTUM] += min(dt, k.contact_sense) * (torque - k.arm_damping * arm_speed - environment)
    side = math.copysign(1.0, desired)
    # Torque against the command is no contact of this command, and without one there is none.
    scale = max(abs(desired), k.lambda_ * abs(arm_speed), k.smallest_torque)
    share = 0.0 if desired == 0.0 else side * environment / scale
    hit = side * min(max(share / k.impact_share - 1.0, 0.0), 1.0)
    faded = k.forgetting * memory[_IMPACT]
    memory[_IMPACT] = hit if side * hit > side * faded else faded
    # What is remembered of the other side does not concern this command.
    remembered = 0.0 if desired == 0.0 else max(side * memory[_IMPACT], 0.0)
    impact = _rise(remembered, FORGOTTEN)
    touching = _rise(share, k.contact_share)
    contact = max(touching, impact)
    memory[_BOUNCE] = max(k.forgetting * memory[_BOUNCE], impact * (1.0 - touching))
    bounced = _rise(memory[_BOUNCE], FORGOTTEN) if remembered > 0.0 else 0.0

    # What the joint shall hold, the velocity that gets it there, the current that gives the velocity.
    damping = k.lambda_ - k.arm_damping + k.rebound_damping * bounced
    wanted = side * ((1.0 - k.caution * bounced) * desired - damping * arm_speed)
    inside = min(max(wanted, -bounced * abs(desired)), abs(desired))
    wanted = inside + (1.0 - contact) * (wanted - inside)
    rate = k.stiffness / k.lambda_
    rate += contact * max(k.contact_rate - rate, 0.0)
    target = arm_speed + rate / k.stiffness * (side * wanted - torque)
    drive = k.motor_inertia * k.motor_rate * (target - speed) + k.motor_damping * speed
    current = (drive + torque - disturbance) / k.torque_constant
    memory[_APPLIED] = min(max(current, -k.current_limit), k.current_limit)
    memory[_TORQUE] = torque
    return current
