"""Between the true angle and what the recording says: scale, eccentricity, delay, stamps that are off."""

from __future__ import annotations

from .entry import EffectEntry, EffectParameter

ENCODER_SCALE = EffectEntry(
    name="encoder_scale",
    kind="output",
    where=("motor_encoder", "arm_encoder"),
    parameters=(
        EffectParameter(
            "scale", "1", "reported over true angle", minimum=0.1, maximum=10.0, typical=1.03, neutral=1.0
        ),
    ),
    sentence="the encoder reports angles by a constant factor too large or too small",
    equation=lambda s, p: p.scale * s.position,
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
        EffectParameter("phase", "rad", "phase at zero angle", typical=0.5, default=0.0, neutral=None),
    ),
    sentence="the encoder's reading errs periodically with the angle, as an eccentric disc does",
    # Encoders are zeroed at the start of a recording near zero angle: the error there is zero by definition.
    equation=lambda s, p: s.position + p.amplitude * (s.sin(p.order * s.position + p.phase) - s.sin(p.phase)),
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
        ),
    ),
    sentence="the encoder reports where the axis was a fixed time ago",
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
        ),
    ),
    sentence="one recorded channel is stamped late or early against the others",
)

ENTRIES = (ENCODER_SCALE, ENCODER_ECCENTRICITY, SENSOR_DELAY, CHANNEL_SKEW)
