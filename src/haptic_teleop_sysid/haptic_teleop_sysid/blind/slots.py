"""Where each number of the concealed physics lies in the vector that the integrator reads.

A slot that is zero is physics that is absent. Slots of one side come twice, as `m_...` (motor) and `a_...`
(arm). Times in s, angles in rad, torques in N·m, current in A.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_SIDE = (
    "fric_pos",  # level of dry friction in positive direction
    "fric_neg",  # and in negative direction
    "break_ratio",  # extra level near standstill, relative
    "break_velocity",
    "break_shape",  # exponent of the decay over velocity: 2 = Gaussian, 1 = exponential
    "bristle",  # deflection at which a bristle slides
    "fric_amp",  # position dependence: relative amplitude, order, phase
    "fric_order",
    "fric_phase",
    "dwell_gain",  # friction that grows with the time since the last motion: relative growth, time constant
    "dwell_time",
    "drag",
    "cubic_drag",
    "grav",
    "grav_phase",
    "ground",
    "ground_rest",
    "constant",
    "visc_change",  # relative change of viscous friction, its time constant
    "visc_time",
    "visc_angle",  # viscous friction that depends on the angle: relative amplitude, order
    "visc_order",
    "stop_angle",  # 0: none; its sign says on which side
    "stop_stiffness",
    "stop_damping",
    "scale",  # of the encoder, relative error
    "ecc_amp",
    "ecc_order",
    "ecc_phase",
    "sensor_delay",
    "detent",  # a torque confined to one place: amplitude, place, width
    "detent_at",
    "detent_width",
    "cross_fric",  # friction that grows with the speed of the other stage, N·m/(rad/s)
)
_OTHERS = (
    "load_coefficient",
    "load_bristle",
    "ripple",
    "ripple_order",
    "ripple_phase",
    "gap",
    "gap_damping",
    "cubic",
    "hyst_torque",
    "hyst_yield",
    "hyst_shape",
    "joint_damping",
    "creep_stiffness",
    "creep_time",
    "delay",
    "lag",
    "limit",
    "dead",
    "gain_error",
    "gain_change",
    "gain_time",
    "current_step",
    "sense_sees",
    "coupling",
    "mode_stiffness",
    "mode_inertia",
    "mode_damping",
    "payload",
    "payload_time",
    "speed_limit",
    "speed_slope",
    "inertia_amp",
    "inertia_order",
    "inertia_phase",
)
NAMES = tuple(f"{side}_{name}" for side in ("m", "a") for name in _SIDE) + _OTHERS
INDEX = {name: number for number, name in enumerate(NAMES)}
SIDE_SIZE = len(_SIDE)
SIDE = {name: number for number, name in enumerate(_SIDE)}


def empty() -> NDArray[np.float64]:
    """Return the vector of a robot without any effect."""
    return np.zeros(len(NAMES))
