"""Is an effect large enough to matter, and different enough from its simpler form to bear its own name?

A fit always finds *some* Stribeck dip or *some* difference between two directions.  What follows are the
least sizes at which the name says something: below, the simpler form (or none) stands.
"""

from __future__ import annotations

import math

from haptic_teleop_sim.model import Effect

from .admissible import friction_drives
from .scales import Scales

#: A friction form is called by its own name when it departs from plain Coulomb friction by this much.
_DISTINCT = 0.2
#: Least size of a torque, as a share of the rms input torque.
_SMALL_TORQUE = 0.0001
#: Least delay as a share of the sample period: less is not told from how the samples were taken.
_SHARE_OF_SAMPLE = 0.003
#: Share of the whole travel up to which a contact that gives before it slides bears its own name.
_STILL = 0.3

#: Least error of an encoder in its steps, which average out over many readings, and how much of its sine must
#: have been seen, rad.
_BELOW_RESOLUTION = 0.1
_SOME_BEND = 0.6

#: Share of the recording over which a drift takes place at least; least stiffness of a stop as a share of the
#: joint's (of a rigid axis: of torque per angle).
_AT_ONCE = 0.02
_A_STOP = 0.1

#: Cycles per sample up to which a mode is one.
_FASTEST = 0.2


def material(effect: Effect, scales: Scales) -> bool:
    """Whether the effect, with these parameters, deserves its name on such a recording."""
    if friction_drives(effect, scales):
        return False
    p = effect.values
    torque = scales.size["torque"]
    channel = 1 if "_arm" in effect.location else 0
    name = effect.effect
    if name == "stribeck_friction":
        return (
            p["breakaway"] > (1 + _DISTINCT) * p["coulomb"]
            and p["breakaway"] > _SMALL_TORQUE * torque
            and p["velocity"] > 1e-3 * scales.size["velocity"]
        )
    if name == "asymmetric_friction":
        total = p["positive"] + p["negative"]
        return total > 2 * _SMALL_TORQUE * torque and abs(p["positive"] - p["negative"]) > _DISTINCT * total
    if name == "presliding_friction":
        gives = p["torque"] / p["stiffness"]
        # A contact that hardly ever slides is a spring.
        least, most = scales.contacts(channel)[1], _STILL * scales.span(channel)
        return p["torque"] > _SMALL_TORQUE * torque and least < gives < most
    if name == "position_dependent_friction":
        # A sine of which less than a quarter was seen is a slope, not an order.
        return (
            p["amplitude"] > _DISTINCT * max(p["torque"], 1e-12)
            and p["amplitude"] > _SMALL_TORQUE * torque
            and p["order"] * scales.span(channel) > math.pi / 2
        )
    if name == "torque_ripple":
        return p["amplitude"] > _SMALL_TORQUE * torque and p["order"] * scales.span(channel) > math.pi / 2
    if name == "encoder_eccentricity":
        return (
            p["amplitude"] > _BELOW_RESOLUTION * scales.resolution[channel]
            and p["order"] * scales.span(channel) > _SOME_BEND
        )
    if name == "encoder_scale":
        return abs(p["scale"] - 1.0) > 2e-5
    if name in ("coulomb_friction", "constant_torque", "gravity", "hysteresis"):
        return abs(p["torque"]) > _SMALL_TORQUE * torque
    if name in ("input_delay", "actuator_lag", "sensor_delay", "channel_skew"):
        return abs(p["time_constant" if name == "actuator_lag" else "delay"]) > _SHARE_OF_SAMPLE * scales.dt
    if name in ("friction_drift", "gain_drift"):
        # What has changed as soon as the recording begins does not drift.
        return abs(p["change"]) > 0.003 and p["time_constant"] > _AT_ONCE * scales.size["duration"]
    if name == "backlash":
        return p["width"] > max(scales.resolution)
    if name == "dead_zone":
        return p["width"] > 2 * _SMALL_TORQUE * torque
    if name == "torque_saturation":
        return p["limit"] < scales.size["peak"]
    if name == "load_dependent_friction":
        return p["coefficient"] > 0.002
    if name == "payload_change":
        return (
            abs(p["inertia"]) > 0.0003 * scales.size["inertia"]
            and 0.02 < p["time"] / scales.size["duration"] < 0.98
        )
    if name == "extra_flexible_mode":
        # Near the sampling rate a mode is but another inertia or a filter.
        return p["frequency"] * scales.dt < _FASTEST
    if name == "hard_stop":
        # What gives way far more than the joint itself stops nothing: it is a spring.
        reach = scales.highest[channel] if p["angle"] > 0 else scales.lowest[channel]
        return (
            abs(reach) > abs(p["angle"])
            and reach * p["angle"] > 0
            and p["stiffness"] > _A_STOP * scales.size["stiffness"]
        )
    practical = effect.entry.practical
    return practical is None or practical(p, scales.size, scales.span(channel))
