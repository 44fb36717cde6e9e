"""Weekly recordings of one simulated stage over a year, in which it may grow old."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from identification_plants import STAGE, stage_recording

from haptic_teleop_control.recording import JointStateSeries, write_recording
from haptic_teleop_control.robots import VELOCITY_FILTER_CUTOFF_HZ, VELOCITY_FILTER_DAMPING
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.recordings.velocity_series import velocity_series

FRICTION = "stage1_motor.coulomb_friction.torque"
NEW = replace(
    STAGE.with_effects(Effect("coulomb_friction", "stage1_motor", {"torque": 0.3})),
    fixed=("torque_constant",),
)
FIRST_WEEK = 1_767_603_600_000_000_000
"""ns, a Monday morning."""
WEEK = 7 * 86_400 * 10**9
_VARIES = 0.01


@dataclass(frozen=True)
class Ageing:
    """From which week on, and how much a week, as a share of the new value; ``slip``: the week in which the
    motor's encoder slips once, by 0.05 rad."""

    friction: tuple[int, float] | None = None
    stiffness: tuple[int, float] | None = None
    slip: int | None = None


def robot(week: int, seed: int, ageing: Ageing) -> Model:
    """The robot in a week (from 1 on); its friction and damping are 1 % (rms) off, by the temperature."""
    random = np.random.default_rng((seed, week))
    values = NEW.parameter_values()
    factors = {FRICTION: 1.0, "motor_damping": 1.0, "stiffness": 1.0}
    for name, growth in ((FRICTION, ageing.friction), ("stiffness", ageing.stiffness)):
        if growth is not None:
            factors[name] += growth[1] * max(week - growth[0] + 1, 0)
    for name in (FRICTION, "motor_damping"):
        factors[name] *= 1.0 + _VARIES * random.standard_normal()
    return NEW.with_values({name: values[name] * factor for name, factor in factors.items()})


def write_week(folder: Path, week: int, seed: int = 1, ageing: Ageing | None = None, seconds=6.0) -> Path:
    """Write the recording of a week into a folder, named so that names are in another order than weeks."""
    ageing = ageing or Ageing()
    made = stage_recording(robot(week, seed, ageing), seed=1000 * seed + week, seconds=seconds)
    shift = FIRST_WEEK + (week - 1) * WEEK
    topics = {}
    for topic, series in made.topics.items():
        stamps, received = (
            series.stamp - series.stamp[0] + shift,
            series.received - series.received[0] + shift,
        )
        topics[topic] = replace(series, stamp=stamps, received=received)
    states = topics["/sfj/joint_states"]
    if week == ageing.slip:
        topics["/sfj/joint_states"] = _slipped(states)
    name = f"{(week * 37) % 101:03d}_week_{week:02d}"
    return write_recording(folder / name, topics, {}, made.experiment)


def _slipped(states: JointStateSeries, size: float = 0.05) -> JointStateSeries:
    assert states.position is not None and states.velocity is not None
    column = states.names.index("stage1_motor")
    position, velocity = states.position.copy(), states.velocity.copy()
    position[len(position) // 2 :, column] += size
    velocity[:, column] = velocity_series(
        position[:, column], 0.002, VELOCITY_FILTER_CUTOFF_HZ, VELOCITY_FILTER_DAMPING
    )
    return replace(states, position=position, velocity=velocity)
