"""The input of a log between its samples: held, or straight."""

from dataclasses import replace

import numpy as np
import pytest
from stepped_machines import RIGID

from haptic_teleop_sim.kernel import simulate
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.inputs.between_samples import (
    TOLD,
    as_it_acts,
    half_a_sample,
    may_be_straight,
    straight,
)
from haptic_teleop_sysid.recordings.dataset import DataSet

DT, N, FINE = 2e-3, 6000, 10


def log(seed, held):
    """What a log has of a body under a torque of many tones: one that changes all the time and is read at the
    samples, or one that acts from its sample to the next."""
    generator = np.random.default_rng(seed)
    fine = DT / FINE * np.arange(N * FINE)
    tones = generator.uniform(0.5, 12.0, 12)
    phases = generator.uniform(0.0, 6.0, 12)
    torque = sum(0.3 * np.sin(2 * np.pi * f * fine + p) for f, p in zip(tones, phases, strict=True))
    read = torque[::FINE]
    motion = simulate(RIGID, np.repeat(read, FINE) if held else torque, DT / FINE)
    angle = np.rint(motion.motor_position[::FINE] / 1e-5) * 1e-5
    return DataSet(
        name=f"log {seed}",
        robot="generic",
        joint="j",
        dt=DT,
        input=read,
        input_unit="N*m",
        input_source="measured effort",
        motor_position=angle,
        motor_velocity=motion.motor_velocity[::FINE],
        valid=np.ones(N, dtype=np.bool_),
        experiment={"kind": "imported"},
    )


@pytest.mark.parametrize("held", [True, False])
def test_the_recordings_say_how_the_input_of_a_log_acts(held):
    learn, judge = log(1, held), log(2, held)
    (here,), (there,) = as_it_acts(RIGID, [learn], [judge])
    if held:
        assert here is learn and there is judge
        return
    np.testing.assert_allclose(here.input[:-1], 0.5 * (learn.input[:-1] + learn.input[1:]))
    assert TOLD in here.problems and TOLD in there.problems
    assert not may_be_straight([here])


def test_only_logs_are_asked():
    learn = replace(log(1, held=False), experiment={"kind": "open loop"})
    assert as_it_acts(RIGID, [learn])[0][0] is learn
    assert not may_be_straight([learn], [log(2, held=False)])


def test_a_command_is_read_like_the_input():
    data = replace(log(3, held=True), commanded_input=np.arange(N, dtype=float))
    assert straight(data).commanded_input[:2].tolist() == [0.5, 1.5]


def test_a_wrong_stamp_of_half_a_sample_is_what_lies_between_the_two():
    def skew(delay):
        return [Effect("channel_skew", "j_actuator", {"delay": delay})]

    assert half_a_sample(skew(0.5 * DT), DT) and half_a_sample(skew(-0.45 * DT), DT)
    assert not half_a_sample(skew(2.0 * DT), DT) and not half_a_sample(skew(0.01 * DT), DT)
    assert not half_a_sample([Effect("coulomb_friction", "j_motor", {"torque": 0.5 * DT})], DT)
