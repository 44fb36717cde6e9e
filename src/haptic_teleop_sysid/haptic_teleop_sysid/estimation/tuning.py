"""Finding the levels of the noise model by maximum likelihood."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from haptic_teleop_sim.kernel import Packed

from .likelihood import channels, likelihood_of
from .noise import NoiseModel
from .records import Record

LEVELS = ("motor_torque", "arm_torque", "motor_angle", "arm_angle", "motor_time", "arm_time")
#: Least disturbance relative to the rms input torque. Below, the observer would all but stop correcting its
#: model.
_LEAST_TORQUE = 2e-4
#: Angle by which a disturbance moves a body within a sample, in units of the encoder's noise, from which the
#: observer believes the encoder alone: more says nothing, and the Riccati equation loses its digits.
_MOST_MOVED = 1e6
#: Largest noise of the arm's encoder in steps of it, and as a share of the rms angle.
_MOST_STEPS, _MOST_OF_MOTION = 30.0, 0.1
#: A disturbance that is remembered for longer is a constant to a recording of half a minute, and takes for
#: itself what a constant torque explains.
_BOUNDS = {"motor_time": (2e-3, 10.0), "arm_time": (2e-3, 10.0)}
#: Disturbances of motor and arm at the start, as shares of the rms input torque.
MOTOR_SHARE, ARM_SHARE = 0.05, 0.02


def initial_noise(packed: Packed, records: Sequence[Record]) -> NoiseModel:
    """A start: disturbances of MOTOR_SHARE and ARM_SHARE of the rms input torque, encoder noise from its
    step."""
    torque = packed.torque_constant * float(np.sqrt(np.mean([np.mean(r.input**2) for r in records])))
    torque = max(torque, 1e-9)
    motor, arm = (float(np.mean([r.resolution[i] for r in records])) / np.sqrt(12.0) for i in (0, 1))
    return NoiseModel(MOTOR_SHARE * torque, ARM_SHARE * torque, motor, arm)


def level_bounds(packed: Packed, records: Sequence[Record]) -> dict[str, tuple[float, float]]:
    """Lowest and highest value of every level."""
    torque = packed.torque_constant * float(np.sqrt(np.mean([np.mean(r.input**2) for r in records])))
    least, angles = _LEAST_TORQUE * torque, (1e-12, np.inf)
    steps = [float(np.mean([r.resolution[i] for r in records])) / np.sqrt(12.0) for i in (0, 1)]
    held = min(r.dt for r in records) ** 2 / 2.0
    most_motor = _MOST_MOVED * steps[0] * packed.linear[1] / held
    most_arm = most_motor if packed.rigid else _MOST_MOVED * max(steps) * packed.linear[3] / held
    # Without an upper end a fit may end at an arm whose encoder is not believed at all.
    arms = [r.measured[np.isfinite(r.measured[:, 1]), 1] for r in records]
    moved = max((float(np.std(q)) for q in arms if len(q)), default=0.0)
    most = max(_MOST_STEPS * float(np.mean([r.resolution[1] for r in records])), _MOST_OF_MOTION * moved)
    return {
        "motor_torque": (min(least, 0.1 * most_motor), most_motor),
        "arm_torque": (min(least, 0.1 * most_arm), most_arm),
        "motor_angle": angles,
        "arm_angle": (1e-12, max(most, 1e-9)),
        **_BOUNDS,
    }


def tune_noise(
    packed: Packed,
    noise: NoiseModel,
    records: Sequence[Record],
    *,
    factor: float = 4.0,
    rounds: int = 2,
    enough: float = 0.5,
) -> tuple[NoiseModel, float]:
    """Coordinate search over the logarithms of the levels; the step goes from ``factor`` to its square root
    each round.  Returns the noise model and the log-likelihood."""
    best = likelihood_of(packed, noise, records)
    limits = level_bounds(packed, records)
    for _ in range(rounds):
        for name in LEVELS:
            if packed.rigid and name.startswith("arm"):
                continue
            if name == "arm_angle" and not any(1 in channels(packed, record) for record in records):
                continue
            for step in (factor, 1.0 / factor):
                moved = False
                while True:
                    trial = noise.scaled(**{name: step})
                    low, high = limits[name]
                    if not low <= getattr(trial, name) <= high:
                        break
                    value = likelihood_of(packed, trial, records)
                    if not value > best + enough:
                        break
                    best, noise, moved = value, trial, True
                if moved:
                    break
        factor = float(np.sqrt(factor))
    return noise, best
