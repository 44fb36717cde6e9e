"""Between commanded and acting torque: gain, delay, lag, saturation, dead zone.

Each is a compiled function of the torque of the present sample that may keep a memory, so that the same code
serves a whole recording and a plant that is stepped sample by sample.  What acts is held over the sample:
its mean.  How it was spread within the sample moves the motor a little further or less far at the same final
speed; a delay and a lag therefore also keep the moment of what acted, the integral over the sample of
(torque - mean) times the time that is left, N·m·s², as the last number of their memory.

A step is ``step(torque, time, dt, p, k, z, o)``: it takes the torque so far, N·m, the time of the sample and
its length dt > 0, s, the effect's parameters p[k], p[k + 1], ... and its memory z[o], z[o + 1], ..., which is
zero at first and changed in place.  It returns the torque that acts, the mean over the sample, N·m.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from haptic_teleop_control.compiled import njit

from .entry import EffectEntry
from .hypothesis import Equivalent, Numbers, Recorded, Refinement, as_early, drifts, late, noticeable
from .parameter import EffectParameter

#: Samples of memory of a delay: 256 at 500 Hz are half a second.
DELAY_MEMORY = 256


@njit(cache=True)
def gain_step(torque, time, dt, p, k, z, o):
    """Acting torque, N*m: gain * torque."""
    return p[k] * torque


@njit(cache=True)
def gain_drift_step(torque, time, dt, p, k, z, o):
    """Acting torque, N*m: torque * (1 + change * (1 - exp(-time / time_constant)))."""
    return torque * (1.0 + p[k] * (1.0 - math.exp(-time / p[k + 1])))


@njit(cache=True)
def saturation_step(torque, time, dt, p, k, z, o):
    """Acting torque, N*m: the torque, held between -limit and limit."""
    return min(max(torque, -p[k]), p[k])


@njit(cache=True)
def dead_zone_step(torque, time, dt, p, k, z, o):
    """Acting torque, N*m: sign(torque) * max(|torque| - width, 0)."""
    return max(torque - p[k], 0.0) + min(torque + p[k], 0.0)


@njit(cache=True)
def lag_step(torque, time, dt, p, k, z, o):
    """Acting torque, N*m: mean over the sample of y, where time_constant * y' = torque - y, solved exactly.

    Memory: y at the end of the sample, N*m, and the moment of what acted, N*m*s^2. A time constant below
    1e-9 s passes the torque through.
    """
    tau = p[k]
    if tau < 1e-9:
        z[o + 1] = 0.0
        return torque
    decay = math.exp(-dt / tau)
    start = z[o]
    z[o] = torque + (start - torque) * decay
    z[o + 1] = (start - torque) * tau * (0.5 * dt * (1.0 + decay) - tau * (1.0 - decay))
    return torque + (start - torque) * tau / dt * (1.0 - decay)


@njit(cache=True)
def delay_step(torque, time, dt, p, k, z, o):
    """Acting torque, N*m: mean over the sample of torque(t - delay), zero before the first sample.

    With a delay of d whole samples and a fraction f of one, sample n gives
    (1 - f) * torque[n - d] + f * torque[n - d - 1]. Delays beyond the memory count as its length.
    Memory: how many samples there were, a ring of past torques, N*m, and the moment of what acted, N*m*s^2.
    """
    size = DELAY_MEMORY - 1
    n = int(z[o])
    z[o + 1 + n % size] = torque
    z[o] = n + 1
    samples = p[k] / dt
    if samples < 0.0:
        samples = 0.0
    if samples > size - 2:
        samples = size - 2.0
    whole = int(samples)
    fraction = samples - whole
    newer = z[o + 1 + (n - whole) % size] if n - whole >= 0 else 0.0
    older = z[o + 1 + (n - whole - 1) % size] if n - whole - 1 >= 0 else 0.0
    z[o + 1 + size] = 0.5 * dt * dt * (older - newer) * fraction * (1.0 - fraction)
    return (1.0 - fraction) * newer + fraction * older


def _duration(
    name: str, meaning: str, typical: float, maximum: float, hills: bool = False
) -> EffectParameter:
    """A time between command and torque, s."""
    return EffectParameter(
        name,
        "s",
        meaning,
        minimum=0.0,
        maximum=maximum,
        typical=typical,
        grid=(0.5 * typical, 2.0 * typical, 5.0 * typical),
        hills=hills,
        in_current="time",
    )


def _limits_at_speed(p: Numbers, on: Recorded) -> bool:
    """Within the speeds that were reached it takes away some of the torque that was asked for."""
    lost = p["slope"] * on.size["fastest"]
    return lost > 0.02 * on.size["peak"] and p["limit"] - lost < on.size["peak"]


GAIN_ERROR = EffectEntry(
    name="gain_error",
    kind="input",
    where=("actuator",),
    parameters=(
        EffectParameter(
            "gain",
            "of the command",
            "acting over commanded torque",
            minimum=0.01,
            maximum=100.0,
            typical=1.2,
            neutral=1.0,
        ),
    ),
    sentence="the actuator gives more (or less) torque than its nominal constant says",
    step=gain_step,
    condition="input",
    follows="input",
    same_as="torque_constant",
    mistaken=(
        "stiffness",
        "a stiffness that is believed and off by as much, and with it all inertias and dampings, would look "
        "the same: measure it once more",
    ),
)
GAIN_DRIFT = EffectEntry(
    name="gain_drift",
    kind="input",
    where=("actuator",),
    parameters=(
        EffectParameter(
            "change",
            "of the gain",
            "relative change of the gain, in the end",
            minimum=-0.99,
            maximum=10.0,
            typical=-0.2,
        ),
        EffectParameter(
            "time_constant",
            "s",
            "time over which it changes",
            minimum=0.05,
            typical=0.3,
            scale="duration",
            grid=(0.1, 0.4, 1.5),
            neutral=None,
        ),
    ),
    sentence="the torque per current changes in the course of the recording, as a warming motor's does",
    step=gain_drift_step,
    condition="input and time",
    follows="time",
    practical=drifts,
)
#: Share of the rms torque below which a limit leaves nothing of the input, which then would drive nothing.
LEAST_LEFT = 0.2

TORQUE_SATURATION = EffectEntry(
    name="torque_saturation",
    kind="input",
    where=("actuator",),
    momentary=True,
    parameters=(
        EffectParameter(
            "limit",
            "N*m",
            "largest torque that acts",
            minimum=1e-9,
            typical=0.8,
            scale="peak",
            # A limit that only the highest peaks reach cuts little, and a fit sees nothing of it from above.
            grid=(0.99, 0.96, 0.92, 0.87, 0.8, 0.7, 0.6, 0.5, 0.35, 0.2),
            neutral=math.inf,
            in_current="peak",
        ),
    ),
    sentence="the actuator gives no more than a certain torque",
    of_command=True,
    step=saturation_step,
    condition="large inputs",
    follows="input",
    practical=lambda p, on: LEAST_LEFT * on.size["torque"] < p["limit"] < on.size["peak"],
    large=True,
)


def _within_speed_limit(s: Any, p: Any) -> Any:
    """The input held between what is left at this speed in either direction; braking has all of it."""
    ahead = s.positive_part(p.limit - p.slope * s.positive_part(s.velocity))
    back = s.positive_part(p.limit - p.slope * s.positive_part(-s.velocity))
    return s.input - s.positive_part(s.input - ahead) + s.positive_part(-s.input - back)


def _less_at_speed(p: Numbers, on: Recorded, scanned: float) -> Iterator[dict[str, float]]:
    """As much torque at the rms velocity as under a constant limit, more at standstill, by several shares."""
    for share in (0.1, 0.3, 0.8):
        yield {"limit": (1 + share) * p["limit"], "slope": share * p["limit"] / on.size["velocity"]}


TORQUE_SPEED_LIMIT = EffectEntry(
    name="torque_speed_limit",
    kind="torque",
    where=("actuator",),
    momentary=True,
    parameters=(
        EffectParameter(
            "limit",
            "N*m",
            "largest torque at standstill",
            minimum=1e-9,
            typical=0.9,
            scale="peak",
            grid=(1.2, 0.8),
            neutral=math.inf,
        ),
        EffectParameter(
            "slope",
            "N*m*s/rad",
            "torque that is lost per speed in the driving direction",
            minimum=0.0,
            typical=0.3,
            scale="peak_per_speed",
            grid=(0.3, 0.8),
            neutral=None,
        ),
    ),
    sentence="the faster the drive turns, the less torque is left, as a motor at the end of its voltage",
    equation=lambda s, p: _within_speed_limit(s, p) - s.input,
    rate=lambda p, ks: (0.0, p["slope"]),
    needs="a recorded command: the measured current shows what is left already",
    of_command=True,
    condition="large inputs at speed",
    follows="input",
    form_of="torque_saturation",
    refinement=Refinement("torque_saturation", _less_at_speed),
    large=True,
    practical=_limits_at_speed,
)
DEAD_ZONE = EffectEntry(
    name="dead_zone",
    kind="input",
    where=("actuator",),
    parameters=(
        EffectParameter(
            "width",
            "N*m",
            "largest torque, of either sign, that has no effect",
            minimum=0.0,
            typical=0.4,
            scale="torque",
            grid=(0.2, 0.6, 1.2),
            in_current="rms",
        ),
    ),
    sentence="small commanded torques have no effect",
    step=dead_zone_step,
    condition="small inputs",
    follows="input",
    practical=noticeable("width", times=2),
    large=True,
)
ACTUATOR_LAG = EffectEntry(
    name="actuator_lag",
    kind="input",
    where=("actuator",),
    parameters=(_duration("time_constant", "time constant of the first-order response", 0.02, 5.0),),
    sentence="the torque follows its command with a first-order lag",
    step=lag_step,
    states=2,
    spread=True,
    condition="changes of the input",
    follows="input rate",
    practical=late("time_constant"),
    large=True,
)
INPUT_DELAY = EffectEntry(
    name="input_delay",
    kind="input",
    where=("actuator",),
    parameters=(_duration("delay", "delay between command and torque", 0.01, 0.25, hills=True),),
    sentence="the torque acts a fixed time after its command",
    step=delay_step,
    states=DELAY_MEMORY + 1,
    spread=True,
    condition="changes of the input",
    follows="input rate",
    separated=(("actuator_lag", "excite up to frequencies above 1 / (2 delay)"),),
    practical=late("delay"),
    families=("late torque",),
    equivalents=(Equivalent("channel_skew", ("actuator",), as_early),),
    large=True,
)

ENTRIES = (
    INPUT_DELAY,
    ACTUATOR_LAG,
    TORQUE_SATURATION,
    TORQUE_SPEED_LIMIT,
    DEAD_ZONE,
    GAIN_ERROR,
    GAIN_DRIFT,
)
