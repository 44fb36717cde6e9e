"""Encoders that slip are put back where they were; nothing that a joint does is taken for a slip."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from joint_recordings import TRUTH, excitation, joint_recording, response

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.recordings.dataset import load_dataset
from haptic_teleop_sysid.recordings.slips import put_back, slips

DT = 0.002
TIME = DT * np.arange(4000)
WAY = 0.4 * np.sin(2.0 * TIME) + 0.1 * np.sin(9.0 * TIME + 1.0)
STEP = 2.5e-4
TOPIC = "/sfj/joint_states"


def counted(values, step=STEP):
    return step * np.round(values / step)


@settings(max_examples=60, deadline=None)
@given(
    st.integers(50, 3900),
    st.floats(0.004, 3.0),
    st.sampled_from([-1.0, 1.0]),
    st.sampled_from([1e-12, STEP, 5 * STEP]),
)
def test_a_slip_is_found_and_put_back(index, size, sign, step):
    size = max(size, 20 * step)  # what encoder steps permit to see
    slipped = counted(WAY, step)
    slipped[index:] += sign * size
    found = slips(slipped, TIME)
    assert [s.index for s in found] == [index]
    assert found[0].size == pytest.approx(sign * size, abs=2.5 * step + 1e-4)
    assert np.max(np.abs(put_back(slipped, found) - WAY)) < 3.0 * step + 1e-4


def test_two_slips_are_put_back_one_by_one():
    slipped = counted(WAY)
    slipped[1000:] += 0.02
    slipped[3000:] -= 0.05
    found = slips(slipped, TIME)
    assert [s.index for s in found] == [1000, 3000]
    assert np.max(np.abs(put_back(slipped, found) - WAY)) < 3 * STEP


@pytest.mark.parametrize(
    "way",
    [
        np.abs(WAY),  # a stop, from which the joint bounces
        np.maximum(WAY, 0.1),  # one at which it stays
        np.cumsum(np.random.default_rng(1).normal(size=4000)) * 1e-4,
        WAY * (TIME > 3.0),  # begins with full speed
        0.2 * np.floor(TIME) / 4.0 + 0.2 * np.clip(10 * (TIME % 1.0), 0, 1) / 4.0,  # ramps
    ],
    ids=["bounce", "stop", "walk", "start", "ramps"],
)
@pytest.mark.parametrize("step", [1e-12, STEP])
def test_motion_does_not_slip(way, step):
    assert slips(counted(way, step), TIME) == []


@pytest.mark.parametrize("length", [2, 5, 20])
def test_a_reading_that_is_held_and_catches_up_has_not_slipped(length):
    held = counted(WAY)
    for start in (500, 1500, 2500):
        held[start : start + length] = held[start]
    assert slips(held, TIME) == []


def test_beside_lost_samples_nothing_is_called_a_slip():
    kept = np.setdiff1d(np.arange(4000), [700, 1201, 1202, 1203])
    assert slips(counted(WAY)[kept], TIME[kept]) == []


def test_a_recording_is_put_back_and_says_so():
    current = excitation(4000)
    states = response(current)
    recording = joint_recording(current, states)
    position = recording.topics[TOPIC].position.copy()
    position[1500:, 1] += 0.03
    recording.topics[TOPIC] = replace(recording.topics[TOPIC], position=position)
    dataset = load_dataset(
        recording, Model("sfj", "stage1", "flexible_joint", TRUTH, source="stage1.yaml"), "mybag"
    )
    assert [(s.encoder, s.time) for s in dataset.slips] == [("stage1_arm_encoder", pytest.approx(3.0))]
    assert np.allclose(dataset.arm_position, states[:, 1], atol=1e-5)
    assert np.max(np.abs(dataset.arm_velocity)) < 1.5 * np.max(np.abs(states[:, 3]))
    assert dataset.valid.all()
    assert any("0.03 rad elsewhere from 3.000 s" in p for p in dataset.problems)


def test_too_many_slips_are_told_and_left():
    current = excitation(4000)
    states = response(current)
    recording = joint_recording(current, states)
    position = recording.topics[TOPIC].position.copy()
    for start in range(100, 3900, 140):
        position[start:, 1] += 0.02
    recording.topics[TOPIC] = replace(recording.topics[TOPIC], position=position)
    model = Model("sfj", "stage1", "flexible_joint", TRUTH, source="stage1.yaml")
    dataset = load_dataset(recording, model, "mybag")
    assert dataset.slips == ()
    assert np.array_equal(dataset.arm_position, position[:, 1])
    assert any("jumps elsewhere 28 times" in p for p in dataset.problems)


def test_slow_recordings_tell_no_slip():
    snapped = np.repeat([0.0, 0.3, 0.0, 0.3], 1000) + 1e-4 * np.sin(np.arange(4000.0))
    assert len(slips(snapped, 0.002 * np.arange(4000))) == 3
    assert slips(snapped, 0.01 * np.arange(4000)) == []
