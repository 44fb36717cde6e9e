"""The input of a log between its samples: held, or read."""

from dataclasses import replace

import numpy as np
import pytest
from stepped_machines import RIGID

from haptic_teleop_sim.kernel import simulate
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis import input_times
from haptic_teleop_sysid.diagnosis.inputs.between_samples import (
    TOLD,
    as_read,
    half_a_sample,
    may_be_read,
    predicted_better,
)
from haptic_teleop_sysid.diagnosis.run import diagnose
from haptic_teleop_sysid.recordings.dataset import DataSet

DT, N, FINE = 2e-3, 6000, 10


def log(seed, held, machine=RIGID):
    """What a log has of a body under a torque of many tones: one that changes all the time and is read at the
    samples, or one that acts from its sample to the next."""
    generator = np.random.default_rng(seed)
    tones = generator.uniform((0.5, 0.0), (12.0, 6.0), (12, 2))

    def torque(time):
        return sum(0.3 * np.sin(2 * np.pi * tone * time + phase) for tone, phase in tones)

    read = torque(DT * np.arange(N))
    # In the middle of each fine step: its mean.
    changing = torque(DT / FINE * (np.arange(N * FINE) + 0.5))
    acting = np.repeat(read, FINE) if held else changing
    disturbance = np.repeat(0.005 * np.std(read) * generator.standard_normal(N), FINE)
    motion = simulate(machine, acting + disturbance, DT / FINE)
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
    assert predicted_better(RIGID, [log(1, held)]) is not held


@pytest.mark.long
@pytest.mark.parametrize("held", [True, False])
def test_the_diagnosis_names_nothing_where_nothing_is_hidden_and_says_how_it_read_the_input(held):
    _, _, _, content = diagnose(RIGID, [log(1, held)], [log(2, held)])
    assert (content["verdict"], content["findings"]) == ("no_mismatch", [])
    told = [TOLD in told for told in content["recordings"].values()]
    assert told == [not held, not held]


def test_as_read_it_is_the_mean_from_each_sample_to_the_next_and_is_not_taken_so_twice():
    data = log(1, held=False)
    found = as_read(data)
    middle = data.input[1:-2] + data.input[2:-1]
    assert np.abs(found.input[1:-2] - 0.5 * middle).max() > 1e-4, "it is not straight"
    exact = replace(data, input=np.arange(N, dtype=float) ** 3)
    quarter = np.arange(1, N - 1) ** 4.0 / 4.0
    np.testing.assert_allclose(as_read(exact).input[1:-2], np.diff(quarter), rtol=1e-9)
    assert found.input_read and TOLD in found.problems
    assert may_be_read([data]) and not may_be_read([found])


def test_recordings_of_a_command_are_not_asked():
    bag = replace(log(1, held=False), experiment={"kind": "open loop"})
    measured = replace(bag, input_source="measured effort", commanded_input=None)
    assert may_be_read([measured], [log(2, held=False)]), "an effort that was read beside the angles"
    for other in (
        replace(measured, input_source="commanded effort"),
        replace(measured, commanded_input=bag.input),
        replace(measured, input_read=True),
    ):
        assert not may_be_read([other], [log(2, held=False)])


def test_a_command_is_read_like_the_input():
    data = replace(log(3, held=True), commanded_input=np.arange(N, dtype=float))
    assert as_read(data).commanded_input[:2].tolist() == [0.5, 1.5]


def test_a_wrong_stamp_of_half_a_sample_is_what_lies_between_the_two():
    def skew(delay):
        return [Effect("channel_skew", "j_actuator", {"delay": delay})]

    assert half_a_sample(skew(0.5 * DT), DT) and half_a_sample(skew(-0.45 * DT), DT)
    assert not half_a_sample(skew(2.0 * DT), DT) and not half_a_sample(skew(0.01 * DT), DT)
    assert not half_a_sample([Effect("coulomb_friction", "j_motor", {"torque": 0.5 * DT})], DT)


def test_a_friction_does_not_hide_how_the_input_acts(monkeypatch):
    """Judged without it, half a sample is lost in what friction does; it took a search that found the skew
    and a second one to see it."""
    friction = Effect("coulomb_friction", "j_motor", {"torque": 0.15})
    logs = [log(seed, False, RIGID.with_effects(friction)) for seed in (1, 2)]
    assert not predicted_better(RIGID, logs[:1])
    searched = []
    monkeypatch.setattr(input_times, "explain", lambda *data: searched.append(data[1][0].input_read))
    assert input_times.explained(RIGID, logs[:1], logs[1:], lambda text: None)[1]
    assert searched == [True]
