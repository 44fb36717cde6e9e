"""A data set holds what acted and what was measured, on the right samples, or says why it cannot."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from joint_recordings import DT, START, TRUTH, excitation, joint_recording, response

from haptic_teleop_control.errors import MismatchError, RecordingError
from haptic_teleop_control.recording import JointStateSeries, Recording
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.recordings.dataset import load_dataset

MODEL = Model("sfj", "stage1", "flexible_joint", TRUTH, source="stage1.yaml")
CURRENT = excitation(2000)
STATES = response(CURRENT)
IO = {
    "input": {"topic": "/plant", "joint": "j", "field": "effort"},
    "motor": {"topic": "/plant", "joint": "j"},
    "arm": None,
}
KNEE = {"topic": "/sfj/joint_states", "joint": "knee"}
RIGID = Model(
    "generic",
    "j",
    "rigid_body",
    {"torque_constant": 1.0, "motor_inertia": 0.1, "motor_damping": 0.1},
    io=IO,
    source="generic.yaml",
)


def made(**changes):
    return joint_recording(CURRENT, STATES, **changes)


def with_states(recording, **changes):
    states = recording.topics["/sfj/joint_states"]
    recording.topics["/sfj/joint_states"] = replace(states, **changes)
    return recording


def picked(recording, keep):
    """The recording with only some of its states."""
    states = recording.topics["/sfj/joint_states"]
    arrays = ("stamp", "received", "position", "velocity", "effort")
    return with_states(recording, **{name: getattr(states, name)[keep] for name in arrays})


def plant(stamps, position, effort, **changes):
    series = JointStateSeries(stamps, stamps, ("j",), position[:, None], None, effort[:, None])
    return Recording(Path("plant"), {"/plant": replace(series, **changes)})


def test_the_input_is_the_current_that_acts_from_each_sample_on():
    dataset = load_dataset(made(), MODEL)
    assert dataset.input_source == "measured effort"
    assert dataset.input_unit == "A"
    # The last sample's current was never measured.
    assert np.allclose(dataset.input[:-1], CURRENT[:-1], atol=1e-12)
    assert np.allclose(dataset.commanded_input, CURRENT, atol=1e-12)


def test_positions_and_velocities_are_the_recorded_ones_under_their_names():
    recording = made()
    signals = load_dataset(recording, MODEL).signals()
    assert list(signals) == [
        "stage1_motor.position",
        "stage1_motor.velocity",
        "stage1_arm.position",
        "stage1_arm.velocity",
    ]
    assert np.array_equal(signals["stage1_arm.position"], STATES[:, 1])
    recorded = recording.topics["/sfj/joint_states"].velocity
    assert np.array_equal(signals["stage1_motor.velocity"], recorded[:, 0])


@pytest.mark.parametrize("stated", [0.0, -8.925, "abc", None, np.inf])
def test_a_torque_constant_that_cannot_be_is_refused_and_not_replaced_without_a_word(stated):
    with pytest.raises(
        RecordingError, match=r"sfj_driver: stage1\.torque_constant is .*leave it out everywhere for 8\.925"
    ):
        load_dataset(made(parameters={"/sfj/sfj_driver": {"stage1": {"torque_constant": stated}}}), MODEL)


def test_a_torque_constant_stated_by_the_recording_replaces_the_nominal_one():
    dataset = load_dataset(
        made(parameters={"/sfj/sfj_driver": {"stage1": {"torque_constant": 17.85}}}), MODEL
    )
    assert np.allclose(dataset.input[:-1], 0.5 * CURRENT[:-1])


def test_without_measured_effort_the_command_is_the_input():
    dataset = load_dataset(with_states(made(), effort=None), MODEL)
    assert dataset.input_source == "commanded effort"
    assert np.allclose(dataset.input, CURRENT)


def test_a_command_that_was_lost_leaves_the_one_before_in_force():
    recording = made()
    commands = recording.topics["/sfj/effort_command"]
    keep = np.setdiff1d(np.arange(len(CURRENT)), [500])
    recording.topics["/sfj/effort_command"] = JointStateSeries(
        commands.stamp[keep], commands.received[keep], commands.names, effort=commands.effort[keep]
    )
    dataset = load_dataset(recording, MODEL)
    assert dataset.commanded_input[500] == pytest.approx(CURRENT[499])
    assert dataset.commanded_input[501] == pytest.approx(CURRENT[501])


def test_regular_stamps_are_not_resampled_even_with_a_little_jitter():
    recording = made()
    jitter = np.random.default_rng(1).integers(-15_000, 15_000, len(CURRENT))
    jitter[[0, -1]] = 0
    dataset = load_dataset(
        with_states(recording, stamp=recording.topics["/sfj/joint_states"].stamp + jitter), MODEL
    )
    assert not dataset.resampled
    assert dataset.dt == pytest.approx(DT)
    assert np.array_equal(dataset.motor_position, STATES[:, 0])


def test_irregular_stamps_are_brought_to_a_uniform_grid():
    n = 2001
    rng = np.random.default_rng(2)
    t = 0.002 * np.arange(n) + rng.uniform(-3e-4, 3e-4, n)
    stamps = START + np.rint(1e9 * t).astype(np.int64)
    t = (stamps - stamps[0]) * 1e-9
    dataset = load_dataset(plant(stamps, np.sin(3 * t), np.cos(t)), RIGID)
    assert dataset.resampled
    assert np.allclose(np.diff(dataset.time), dataset.dt)
    # Linear interpolation of sin(3t) over at most 2.6 ms errs by at most 9/8 (2.6 ms)².
    assert np.max(np.abs(dataset.motor_position - np.sin(3 * dataset.time))) < 1e-5


def test_a_lost_sample_is_bridged_and_told():
    dataset = load_dataset(picked(made(), np.setdiff1d(np.arange(2000), [700])), MODEL)
    assert len(dataset) == 2000
    assert dataset.valid.all()
    assert dataset.motor_position[700] == pytest.approx(STATES[[699, 701], 0].mean())
    assert any("lost" in problem for problem in dataset.problems)


def test_a_hole_is_refused_and_with_permission_marked_as_not_valid():
    recording = picked(made(), np.r_[0:1000, 1100:2000])
    with pytest.raises(RecordingError, match=r"mybag.*hole.*0\.20.*--allow-gaps"):
        load_dataset(recording, MODEL, "mybag")
    dataset = load_dataset(recording, MODEL, "mybag", allow_gaps=True)
    assert np.array_equal(np.flatnonzero(~dataset.valid), np.arange(1000, 1100))


def test_repeated_and_backward_stamps_are_dropped():
    order = np.r_[0:900, 899, 900:1500, 1200, 1500:2000]
    dataset = load_dataset(picked(made(), order), MODEL)
    assert len(dataset) == 2000
    assert np.array_equal(dataset.motor_position, STATES[:, 0])


def test_a_value_that_is_no_number_is_bridged_and_marked():
    recording = made()
    position = recording.topics["/sfj/joint_states"].position.copy()
    position[300, 1] = np.nan
    dataset = load_dataset(with_states(recording, position=position), MODEL)
    assert np.isfinite(dataset.arm_position).all()
    assert np.array_equal(np.flatnonzero(~dataset.valid), [300])


def test_velocity_is_derived_where_it_was_not_recorded():
    t = 0.002 * np.arange(1500)
    dataset = load_dataset(plant(START + np.rint(1e9 * t).astype(np.int64), np.sin(3 * t), np.cos(t)), RIGID)
    assert np.allclose(dataset.motor_velocity, 3 * np.cos(3 * t), atol=2e-3)
    filtered = load_dataset(with_states(made(), velocity=None), MODEL)
    recorded = load_dataset(made(), MODEL)
    assert np.allclose(filtered.motor_velocity, recorded.motor_velocity, atol=1e-9)


def test_an_arm_of_which_no_reading_is_a_number_is_one_that_nobody_read():
    """Where the velocity is not recorded, either, it ended in an error of arithmetic."""
    stamps, wave = START + 2_000_000 * np.arange(2000), np.sin(0.01 * np.arange(2000))
    positions = np.column_stack([wave, np.full(2000, np.nan)])
    series = JointStateSeries(stamps, stamps, ("j", "k"), positions, None, np.column_stack([wave, wave]))
    model = replace(
        RIGID,
        structure="flexible_joint",
        parameters=TRUTH,
        io={**IO, "arm": {"topic": "/plant", "joint": "k"}},
    )
    dataset = load_dataset(Recording(Path("plant"), {"/plant": series}), model)
    assert dataset.arm_position is None and dataset.arm_velocity is None and np.all(dataset.valid)


def test_a_generic_input_is_not_shifted():
    t = 0.002 * np.arange(500)
    dataset = load_dataset(plant(START + np.rint(1e9 * t).astype(np.int64), np.sin(t), np.cos(t)), RIGID)
    assert np.array_equal(dataset.input, np.cos(t))
    assert list(dataset.signals()) == ["j_motor.position", "j_motor.velocity"]


def test_a_part_keeps_its_time():
    dataset = load_dataset(made(), MODEL).between(1.0, 2.0)
    assert dataset.time[0] == pytest.approx(1.0)
    assert dataset.time[-1] == pytest.approx(2.0)
    assert np.array_equal(dataset.arm_position, STATES[500:1001, 1])
    with pytest.raises(RecordingError, match="--range"):
        dataset.between(3.0, 4.0)


@pytest.mark.parametrize(
    ("model", "words"),
    [
        (replace(MODEL, robot="omni", joint="omni_y"), ["omni_y", "mybag", "/omni/joint_states"]),
        (replace(RIGID), ["generic.yaml", "mybag", "/plant", "io"]),
        (replace(RIGID, io=None), ["generic.yaml", "mybag", "io section"]),
        (replace(RIGID, io={**IO, "motor": KNEE}), ["knee", "stage2_arm"]),
        (replace(RIGID, io={**IO, "input": "effort"}), ["io.input"]),
        (replace(RIGID, io={**IO, "gear": 50}), ["io.gear", "input, motor, arm"]),
        (replace(RIGID, io={**IO, "motor": {**IO["motor"], "topicc": "x"}}), ["io.motor.topicc"]),
    ],
)  # fmt: skip
def test_a_wrong_pair_is_refused_in_one_sentence(model, words):
    with pytest.raises(MismatchError) as refused:
        load_dataset(made(), model, "mybag")
    assert [word for word in words if word not in str(refused.value)] == []


def test_a_stage_that_was_not_recorded_is_named():
    recording = made()
    states = recording.topics["/sfj/joint_states"]
    recording.topics["/sfj/joint_states"] = JointStateSeries(
        states.stamp, states.received, states.names[2:], states.position[:, 2:], None, states.effort[:, 2:]
    )
    with pytest.raises(MismatchError, match=r"stage1.yaml.*mybag.*stage1_motor.*stage2_motor, stage2_arm"):
        load_dataset(recording, MODEL, "mybag")


def beside(position):
    """The recording with the other arm at ``position`` (n,)."""
    recording = made()
    states = recording.topics["/sfj/joint_states"]
    positions = states.position.copy()
    positions[:, states.names.index("stage2_arm")] = position
    return with_states(recording, position=positions)


def test_the_other_arm_counts_where_it_was_read_and_without_readings_that_cannot_be_true():
    time = DT * np.arange(len(CURRENT))
    swing = np.round(0.4 * np.sin(2 * np.pi * 1.5 * time) / 1e-4) * 1e-4
    clean = load_dataset(beside(swing), MODEL).exogenous
    assert np.std(clean) == pytest.approx(0.4 * (3 * np.pi) ** 2 / np.sqrt(2), rel=0.05)
    wild = swing.copy()
    wild[1000] = 1e200
    found = load_dataset(beside(wild), MODEL)
    assert np.allclose(found.exogenous[200:-200], clean[200:-200], atol=0.02 * np.std(clean))
    assert any("stage2_arm.position leaps away and back at 1 sample" in told for told in found.problems)
    assert found.slips == () and found.valid.all()
    assert load_dataset(beside(np.full(len(swing), np.nan)), MODEL).exogenous is None
