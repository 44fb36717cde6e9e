"""Between the true angle and what the recording says: scale, eccentricity, delay, stamps that are off."""

from __future__ import annotations

from .entry import EffectEntry
from .hypothesis import Equivalent, Numbers, Recorded, as_early, late, seen_once
from .parameter import EffectParameter

#: Least error of an encoder in its steps, which average out over many readings, and how much of its sine must
#: have been seen, rad; by hand.
_BELOW_RESOLUTION = 0.1
_SOME_BEND = 0.6
#: The most that the error may change with the angle: the eccentricity over the disc's radius, where it has
#: one cycle. From 1 on the reading would go back while the axis moves on. By hand, far beyond any disc; what
#: was fitted to 14 real joints without such an error has 0.3 to 3, to four others less.
_STEEPEST_ERROR = 0.3
#: A reading that is late, by a delay or by its stamp; the same of a torque.
LATE_READING, LATE_TORQUE = "late reading", "late torque"


def _errs(p: Numbers, on: Recorded) -> bool:
    """An error that the encoder's steps let through, of a sine of which enough was seen, and not so steep
    that it is none of an encoder."""
    seen = p["amplitude"] > _BELOW_RESOLUTION * on.resolution and p["order"] * on.span > _SOME_BEND
    return seen and abs(p["amplitude"] * p["order"]) < _STEEPEST_ERROR


def _if_late(p: Numbers) -> dict[str, float]:
    """What is late by its stamp is late; nothing is early but a stamp."""
    return {"delay": p["delay"]} if p["delay"] > 0.0 else {}


def _if_early(p: Numbers) -> dict[str, float]:
    """A command that is stamped early is answered late."""
    return {"delay": -p["delay"]} if p["delay"] < 0.0 else {}


def _as_stamp(p: Numbers) -> dict[str, float]:
    """A delay as a stamp that is as late."""
    return {"delay": p["delay"]} if p["delay"] != 0.0 else {}


def _stamped_wrong(place: str, sense_follows: bool) -> float:
    """Delays come from mechanisms before they come from wrong stamps, and a command whose measured current
    follows it (``sense_follows``) was stamped right. By hand."""
    if place == "actuator":
        return 0.1 if sense_follows else 0.8
    return 0.9


ENCODER_SCALE = EffectEntry(
    name="encoder_scale",
    kind="output",
    where=("motor_encoder", "arm_encoder"),
    parameters=(
        EffectParameter(
            "scale",
            "of the true angle",
            "reported over true angle",
            minimum=0.1,
            maximum=10.0,
            typical=1.03,
            neutral=1.0,
        ),
    ),
    sentence="the encoder reports angles by a constant factor too large or too small",
    equation=lambda s, p: p.scale * s.position,
    slope=lambda p: p["scale"],
    condition="{q}",
    practical=lambda p, on: abs(p["scale"] - 1.0) > 2e-5,
)
ENCODER_ECCENTRICITY = EffectEntry(
    name="encoder_eccentricity",
    kind="output",
    where=("motor_encoder", "arm_encoder"),
    parameters=(
        EffectParameter(
            "amplitude", "rad", "amplitude of the error", minimum=0.0, typical=0.02, scale="angle"
        ),
        EffectParameter(
            "order",
            "cycles/rev",
            "cycles per revolution",
            minimum=0.1,
            maximum=200.0,
            typical=1.0,
            grid=(1, 2, 3, 4, 5, 6, 8, 10),
            neutral=None,
            scan="order",
        ),
        EffectParameter(
            "phase", "rad", "phase at zero angle", typical=0.5, default=0.0, neutral=None, turns="phase"
        ),
    ),
    sentence="the encoder's reading errs periodically with the angle, as an eccentric disc does",
    # Encoders are zeroed at the start of a recording near zero angle: the error there is zero by definition.
    equation=lambda s, p: s.position + p.amplitude * (s.sin(p.order * s.position + p.phase) - s.sin(p.phase)),
    condition="{q}, periodically",
    practical=_errs,
    doubtful=seen_once,
)
SENSOR_DELAY = EffectEntry(
    name="sensor_delay",
    kind="skew",
    where=("motor_encoder", "arm_encoder"),
    parameters=(
        EffectParameter(
            "delay",
            "s",
            "age of the reading",
            minimum=0.0,
            maximum=0.25,
            typical=0.01,
            grid=(0.005, 0.015),
            scan="delay",
        ),
    ),
    sentence="the encoder reports where the axis was a fixed time ago",
    condition="velocity",
    practical=late("delay"),
    families=(LATE_READING,),
    separated=(
        (
            "input_delay",
            "no recording of these channels can tell them apart in a rigid joint: put one and the same "
            "signal (a tap on the joint with a time-stamped contact) on both channels",
        ),
    ),
    equivalents=(Equivalent("channel_skew", ("motor_encoder", "arm_encoder"), _as_stamp),),
)
CHANNEL_SKEW = EffectEntry(
    name="channel_skew",
    kind="skew",
    where=("motor_encoder", "arm_encoder", "actuator"),
    parameters=(
        EffectParameter(
            "delay",
            "s",
            "how late the channel is stamped against the others (negative: early)",
            minimum=-0.25,
            maximum=0.25,
            typical=0.01,
            grid=(-0.015, -0.005, 0.005, 0.015),
            scan="delay",
            in_current="time",
        ),
    ),
    sentence="one recorded channel is stamped late or early against the others",
    condition="velocity",
    condition_at=(("actuator", "changes of the input"),),
    separated=(
        (
            "sensor_delay",
            "no recording of these channels can tell them apart: put one and the same signal (a tap on the "
            "arm with a time-stamped contact) on both channels",
        ),
        (
            "input_delay",
            "record the measured current with the clock of the encoders, or close the loop with a known "
            "controller clock",
        ),
    ),
    practical=late("delay"),
    families=(LATE_READING, LATE_TORQUE),
    equivalents=(
        Equivalent("input_delay", ("actuator",), _if_early),
        Equivalent("sensor_delay", ("motor_encoder", "arm_encoder"), _if_late),
        # Input and angle are all that a rigid joint has: their order in time is one number.
        Equivalent("channel_skew", ("motor_encoder",), as_early, place="actuator", rigid=True),
        Equivalent("channel_skew", ("actuator",), as_early, place="motor_encoder", rigid=True),
    ),
    prior=_stamped_wrong,
)

ENTRIES = (ENCODER_SCALE, ENCODER_ECCENTRICITY, SENSOR_DELAY, CHANNEL_SKEW)
