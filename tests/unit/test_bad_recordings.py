"""Recordings that a diagnosis cannot use, each refused in a sentence; holes are cut out and said."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from identification_plants import STAGE, stage_recording
from joint_recordings import TRUTH
from scipy.linalg import expm
from stepped_machines import pendulum

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_control.recording import write_recording
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.commands import diagnose as command
from haptic_teleop_sysid.diagnosis.evidence.consistency import (
    alike,
    parts_of,
    refuse_other_signs,
    refuse_other_units,
    refuse_unrelated,
    sizes,
    unlike,
)
from haptic_teleop_sysid.diagnosis.inputs.cuts import (
    refuse_too_long,
    with_cuts_told,
)
from haptic_teleop_sysid.diagnosis.inputs.plausible import refuse_kinematic, refuse_motionless
from haptic_teleop_sysid.diagnosis.run import diagnose
from haptic_teleop_sysid.diagnosis.usable import records_of
from haptic_teleop_sysid.estimation.records import record_from
from haptic_teleop_sysid.recordings.dataset import load_dataset
from haptic_teleop_sysid.runs.diagnosis_run import load


def loaded(truth=STAGE, seed=1, seconds=12.0, **more):
    return replace(
        load_dataset(stage_recording(truth, seed=seed, seconds=seconds, **more), STAGE), name=f"bag{seed}"
    )


@pytest.fixture(scope="module")
def data():
    return [loaded(seed=1, rms=0.15), loaded(seed=2, rms=0.1, band=(0.2, 6.0))]


def commanded(datasets):
    return [record_from(d, commanded=True) for d in datasets]


def test_recordings_of_one_machine_pass(data):
    closed = loaded(seed=3, closed=True)
    refuse_other_units(commanded([*data, closed]))
    for one in (*data, closed):
        refuse_kinematic([one])
        refuse_unrelated(record_from(one, commanded=True), "stage1")
        refuse_motionless([record_from(one, commanded=True)], "stage1")


def test_a_log_of_one_step_passes_although_its_input_hardly_varies(data):
    """A wheel runs up to speed under 7 V: of 2000 samples one has another input."""
    time = 0.005 * np.arange(2000)
    angle = -57.0 * (time - 0.05 * (1.0 - np.exp(-time / 0.05)))
    stepped = replace(
        record_from(data[0], commanded=True),
        name="step",
        dt=0.005,
        input=np.where(time > 0.0, -7.0, 0.0),
        measured=np.column_stack([angle, np.full(2000, np.nan)]),
        exogenous=np.zeros(2000),
    )
    refuse_unrelated(stepped, "stage1")
    refuse_other_units([*commanded(data), stepped])
    noise = replace(stepped, input=np.random.default_rng(1).standard_normal(2000))
    with pytest.raises(RecordingError, match="nothing in common"):
        refuse_unrelated(noise, "stage1")


def beam(like, seed):
    """A recording of 15 s of a slow pendulum behind a slow drive, as a rotor lifts a beam; its input is
    binary noise. And the same with an input that never drove it."""
    period, rng = 0.01, np.random.default_rng(seed)
    drive, foreign = (np.repeat(rng.choice([0.0, 0.6], 64), 24) for _ in range(2))
    state = np.array([[0.0, 1.0, 0.0], [-3.6, -0.4, 7.9], [0.0, 0.0, -1.0]])  # angle, velocity, torque
    whole = np.block([[state, np.array([[0.0], [0.0], [1.0]])], [np.zeros((1, 4))]])
    step, now, angle = expm(whole * period), np.zeros(3), np.empty(len(drive))
    for k, value in enumerate(drive):
        angle[k] = now[0]
        now = (step @ np.append(now, value))[:3]
    step = 2.0 * np.pi / 4096
    slow = replace(
        like,
        name="beam",
        dt=period,
        input=drive,
        measured=np.column_stack([step * np.round(angle / step), np.full(len(drive), np.nan)]),
        exogenous=np.zeros(len(drive)),
    )
    return slow, replace(slow, input=foreign)


def test_a_slow_pendulum_behind_a_slow_drive_passes_although_its_input_is_fast(data):
    """The motion follows the slowest part of the input. Of inputs that never drove it some pass by chance."""
    refused = 0
    for seed in range(20):
        slow, foreign = beam(record_from(data[0], commanded=True), seed)
        refuse_unrelated(slow, "stage1")
        try:
            refuse_unrelated(foreign, "stage1")
        except RecordingError:
            refused += 1
    assert refused >= 14


@pytest.mark.parametrize("dt", [0.0005, 0.002])
def test_half_a_second_at_any_rate_is_judged_without_an_error(data, dt):
    slow, _ = beam(record_from(data[0], commanded=True), 1)
    samples = slice(0, 1125)
    short = replace(slow, dt=dt, **{name: getattr(slow, name)[samples] for name in ("input", "measured")})
    refuse_unrelated(replace(short, exogenous=slow.exogenous[samples]), "stage1")


@pytest.mark.parametrize(
    ("field", "factor", "words"),
    [
        ("angle", 180.0 / np.pi, "degrees for radians"),
        ("input", 1000.0, "thousandths"),
        ("input", 100.0, "percent for shares"),
    ],
)
def test_units_that_differ_between_bags_are_named(data, field, factor, words):
    names = ("motor_position", "arm_position") if field == "angle" else ("input", "commanded_input")
    other = replace(data[1], **{n: factor * getattr(data[1], n) for n in names})
    with pytest.raises(RecordingError, match=f"bag2.*bag1.*{words}"):
        refuse_other_units(commanded([data[0], other]))
    with pytest.raises(RecordingError, match=words):
        diagnose(STAGE, data[:1], [other])


@pytest.mark.parametrize("factor", [180.0 / np.pi, np.pi / 180.0])
def test_units_of_the_angle_are_named_although_dry_friction_has_none_of_them(factor):
    """No factor between the inputs makes up for it: of the torque only what friction leaves changes."""
    rubbing = STAGE.with_effects(Effect("coulomb_friction", "stage1_motor", {"torque": 0.5}))
    one, other = loaded(rubbing, seed=1, rms=0.2), loaded(rubbing, seed=2, rms=0.2, band=(0.2, 6.0))
    refuse_other_units(commanded([one, other]))
    names = ("motor_position", "arm_position")
    turned = replace(other, **{n: factor * getattr(other, n) for n in names})
    with pytest.raises(RecordingError, match=r"bag2.*bag1.*degrees for radians"):
        refuse_other_units(commanded([one, turned]))


def test_recordings_of_two_machines_are_refused(data):
    heavy = {
        **TRUTH,
        "motor_inertia": 4 * TRUTH["motor_inertia"],
        "motor_damping": 4 * TRUTH["motor_damping"],
    }
    heavy |= {"arm_inertia": 4 * TRUTH["arm_inertia"], "stiffness": 4 * TRUTH["stiffness"]}
    other = loaded(replace(STAGE, parameters=heavy), seed=2, rms=0.4)
    with pytest.raises(
        RecordingError, match=r"bag2 is .* times that of bag1, so they are hardly of one machine"
    ):
        refuse_other_units(commanded([data[0], other]))


def limited(like, name, size, limit, seed):
    """A rigid drive of one inertia and damping whose torque ends at a limit, moved by noise of some size."""
    rng, period, inertia, damping = np.random.default_rng(seed), 0.005, 0.02, 0.1
    command = size * np.repeat(rng.standard_normal(300), 10)
    decay = np.exp(-damping / inertia * period)
    state, read = np.zeros(2), np.empty(len(command))
    for k, torque in enumerate(np.clip(command, -limit, limit)):
        read[k] = state[0]
        end = torque / damping
        gone = (state[1] - end) * (1.0 - decay) * inertia / damping
        state = np.array([state[0] + end * period + gone, end + (state[1] - end) * decay])
    return replace(
        like,
        name=name,
        dt=period,
        input=command,
        measured=np.column_stack([read, np.full(len(read), np.nan)]),
        exogenous=np.zeros(len(read)),
    )


@pytest.mark.parametrize("size", [0.03, 0.06, 0.1, 0.15, 0.3])
@pytest.mark.parametrize("large", [1.0, 3.0])
def test_a_torque_that_ends_at_a_limit_is_not_another_machine(data, size, large):
    """A large input moves it as little as one of a third would: that is to be found, not refused, beside a
    small one that never reaches the limit, too."""
    like = record_from(data[0], commanded=True)
    refuse_other_units([limited(like, "a", size, 0.2, seed=1), limited(like, "b", large, 0.2, seed=2)])


@pytest.mark.parametrize("factor", [4.0, 2.0 * np.pi, 10.0])
def test_without_a_limit_such_an_input_is_another_machine_s(data, factor):
    like = record_from(data[0], commanded=True)
    one, other = (limited(like, f"free{seed}", 0.3, 10.0, seed) for seed in (1, 2))
    with pytest.raises(RecordingError, match=r"free2 .* times that of free1"):
        refuse_other_units([one, replace(other, input=factor * other.input)])


@pytest.mark.parametrize("factor", [4.0, 2.0 * np.pi, 10.0])
@pytest.mark.parametrize("noise", [0.2, 0.4])
def test_a_limit_is_no_excuse_for_another_unit_of_a_friction(data, factor, noise):
    """Its input is nearly a square wave: clipped anywhere, the two are alike."""
    like = record_from(data[0], commanded=True)
    rng, period = np.random.default_rng(1), 0.005
    time = period * np.arange(3000)
    angle = np.sin(time) + 0.4 * np.sin(2.3 * time + 1.0)
    speed = np.gradient(angle, period)
    torque = np.tanh(speed / 0.02) + 0.02 * speed + 0.01 * np.gradient(speed, period)
    torque = torque + noise * np.repeat(rng.standard_normal(300), 10)
    one = replace(
        like,
        name="one",
        dt=period,
        input=torque,
        measured=np.column_stack([angle, np.full(3000, np.nan)]),
        exogenous=np.zeros(3000),
    )
    with pytest.raises(RecordingError, match=r"other .* times that of one"):
        refuse_other_units([one, replace(one, name="other", input=factor * torque)])


def test_recordings_of_machines_that_have_nothing_in_common_are_refused():
    """A slide with friction and a pendulum with a weight: no factor makes one of the other."""
    slide, weight = pendulum(0, coulomb=2.0), pendulum(1, weight=1.5)
    heavy = replace(slide, name="bag1", input=20.0 * slide.input, measured=0.05 * slide.measured)
    light = replace(weight, name="bag2", input=0.1 * weight.input)
    with pytest.raises(RecordingError, match=r"bag2 is .* times that of bag1, .* hardly of one machine"):
        refuse_other_units([heavy, light])
    with pytest.raises(RecordingError, match=r"bag1 is .* times that of bag2, .* hardly of one machine"):
        refuse_other_units([light, heavy])
    refuse_other_units([heavy, replace(heavy, name="bag2")])
    refuse_other_units([replace(slide, name="bag1"), replace(weight, name="bag2")])  # missing physics


def test_a_motion_that_hardly_accelerates_says_nothing_of_the_units_of_another():
    """Of its inertia the slow motion shows only noise; the fast one needs little but the inertia."""
    rng = np.random.default_rng(4)

    def part(acceleration, velocity, inertia=2.0):
        columns = rng.normal(size=(3000, 2)) * (acceleration, velocity)
        drive = columns @ (inertia, 1.0) + 0.5 * rng.normal(size=3000)
        return drive - drive.mean(), columns - columns.mean(axis=0)

    slow, fast = part(0.001, 1.0), part(1.0, 0.1)
    every, found = sizes([slow, fast])
    assert not 1.0 / 3.0 < found[1, 0] < 3.0, "by the slow motion's numbers the fast one has other units"
    assert not unlike(every[0, 1], every[1, 0]), "the other way round they agree"
    assert alike(slow, fast)
    # What both show differs by as much: these are two machines.
    assert not alike(part(0.5, 1.0), part(0.5, 1.0, inertia=8.0))
    assert not alike((3.0 * slow[0], slow[1]), part(0.001, 1.0))


def test_pieces_of_one_recording_are_not_held_against_each_other(data):
    """A log with holes: its short pieces, each by itself, say little of inertia and friction."""
    whole = commanded(data)
    series = ("input", "measured", "exogenous")
    pieces = [
        replace(r, **{n: getattr(r, n)[k : k + 300] for n in series})
        for r in whole
        for k in range(0, 1500, 300)
    ]
    refuse_other_units(pieces)
    assert [*parts_of(pieces)] == ["bag1", "bag2"]
    loud = [replace(r, input=1000.0 * r.input) if r.name == "bag2" else r for r in pieces]
    with pytest.raises(RecordingError, match=r"bag2.*bag1.*thousandths"):
        refuse_other_units(loud)


def test_an_input_that_does_not_drive_the_joint_is_refused(data):
    strange = replace(data[0], commanded_input=np.random.default_rng(1).standard_normal(len(data[0])))
    with pytest.raises(
        RecordingError, match="bag1: the input has nothing in common with the motion of stage1"
    ):
        records_of([strange])


@pytest.mark.parametrize(("field", "what"), [("motor_position", "angle"), ("motor_velocity", "velocity")])
def test_an_input_that_is_the_motion_itself_is_refused(data, field, what):
    driven = replace(data[0], input=0.7 * getattr(data[0], field))
    with pytest.raises(RecordingError, match=f"the input of stage1 is its {what}.*give the force"):
        refuse_kinematic([driven])


def test_an_input_with_the_other_sign_than_another_recordings_is_refused(data):
    refuse_other_signs(commanded(data))
    turned = replace(commanded(data[1:])[0], input=-commanded(data[1:])[0].input)
    with pytest.raises(RecordingError, match="has the other sign than that of"):
        refuse_other_signs([*commanded(data[:1]), turned])
    # Where both are turned they agree: the page says what one alone does.
    both = [replace(r, input=-r.input) for r in commanded(data)]
    refuse_other_signs(both)


def test_a_joint_without_mass_is_refused(data):
    time = data[0].dt * np.arange(len(data[0]))
    drive = np.sin(2.0 * np.pi * 0.4 * time) + 0.4 * np.sin(2.0 * np.pi * 1.1 * time)
    massless = replace(
        data[0], input=drive, motor_position=0.1 * drive, motor_velocity=0.1 * np.gradient(drive)
    )
    with pytest.raises(RecordingError, match="without mass"):
        refuse_kinematic([massless])


def test_rounded_angles_hide_no_joint_without_mass(data):
    time = data[0].dt * np.arange(len(data[0]))
    speed = sum(np.sin(2.0 * np.pi * f * time + f) for f in (0.4, 1.1, 2.3))
    steps = 2e-4
    angle = steps * np.round(np.cumsum(speed) * data[0].dt / steps)
    found = replace(
        data[0], input=0.1 * speed, motor_position=angle, motor_velocity=np.gradient(angle, data[0].dt)
    )
    share = float(np.corrcoef(found.input, found.motor_velocity)[0, 1]) ** 2
    assert share < 0.9999, "what differentiation leaves of the steps"
    with pytest.raises(RecordingError, match="without mass"):
        refuse_kinematic([found])
    # One slow recording of several is no reason, and of those that are not fitted none is.
    refuse_kinematic([found, data[0]], [found])
    refuse_kinematic([data[0]], [found])


def test_noise_about_one_place_is_no_motion(data):
    record = record_from(data[0], commanded=True)
    noise = 1e-3 * np.random.default_rng(1).standard_normal(len(record))
    still = replace(record, measured=np.column_stack([0.2 + noise, 0.2 + noise]))
    with pytest.raises(RecordingError, match="the motor angle of stage1 does not change"):
        refuse_motionless([still], "stage1")
    refuse_motionless([replace(still, measured=still.measured + record.measured)], "stage1")


def test_an_input_that_only_changes_from_piece_to_piece_drives(data):
    record = record_from(data[0], commanded=True)
    pieces = [replace(record, input=np.full(len(record), level)) for level in (0.1, -0.1)]
    refuse_motionless(pieces, "stage1")
    with pytest.raises(RecordingError, match="the input of stage1 does not change"):
        refuse_motionless([pieces[0], pieces[0]], "stage1")


def test_levels_that_change_at_holes_alone_are_used(data):
    one = data[0]
    valid = np.ones(len(one), dtype=np.bool_)
    half = len(one) // 2
    valid[half - 20 : half + 20] = False
    level = np.where(np.arange(len(one)) < half, 0.1, -0.1)
    steps = replace(one, input=level, commanded_input=level, valid=valid)
    assert len(records_of([steps])) == 2


def test_a_motor_that_nobody_read_does_not_move(data):
    record = record_from(data[0], commanded=True)
    unread = replace(record, measured=np.full_like(record.measured, np.nan))
    with pytest.raises(RecordingError, match="the motor angle of stage1 does not change"):
        refuse_motionless([unread], "stage1")
    refuse_motionless([unread, record], "stage1")


def test_a_joint_that_is_moved_between_pieces_alone_is_not_driven(data):
    record = record_from(data[0], commanded=True)
    still = [replace(record, measured=np.full_like(record.measured, angle)) for angle in (0.0, 1.0)]
    with pytest.raises(RecordingError, match="the motor angle of stage1 does not change"):
        refuse_motionless(still, "stage1")


def test_rounding_of_a_huge_angle_is_no_motion(data):
    record = record_from(data[0], commanded=True)
    rounded = 1e300 * (1.0 + 1e-16 * np.sin(np.arange(len(record))))
    rounded[::3] = np.nextafter(1e300, 2e300)
    still = replace(record, measured=np.column_stack([rounded, rounded]))
    with pytest.raises(RecordingError, match="the motor angle of stage1 does not change"):
        refuse_motionless([still], "stage1")


def test_two_hundred_samples_are_refused_with_what_is_needed():
    with pytest.raises(RecordingError, match=r"200 samples without a hole; .* at least 250 in a row"):
        records_of([loaded(seconds=0.4)])


def holed(recording, *holes):
    """The recording without the messages of each (first, last), s."""
    topics = {}
    for name, series in recording.topics.items():
        time = 1e-9 * (series.stamp - recording.topics["/sfj/joint_states"].stamp[0])
        keep = np.ones(len(time), dtype=bool)
        for first, last in holes:
            keep &= (time < first) | (time >= last)
        parts = {
            n: None if (v := getattr(series, n)) is None else v[keep]
            for n in ("stamp", "received", "position", "velocity", "effort")
        }
        topics[name] = replace(series, **parts)
    return replace(recording, topics=topics)


def test_a_short_hole_is_cut_out_and_said():
    recording = holed(stage_recording(seed=4, seconds=12.0), (5.0, 5.014), (11.5, 11.6))
    with pytest.raises(RecordingError, match="--allow-gaps"):
        load_dataset(recording, STAGE, "bag")
    dataset = with_cuts_told(load_dataset(recording, STAGE, "bag", allow_gaps=True))
    first, second = records_of([dataset])
    assert first.start + len(first) * first.dt == pytest.approx(5.0, abs=0.01)
    assert second.start == pytest.approx(5.014, abs=0.01)
    told = dataset.problems[-1]
    assert "cut apart at its holes and used from 0.000 to 5.0" in told
    assert "0.5" in told.partition("; ")[2]  # the rest behind the second hole is too short
    assert not told.startswith("only ")
    torn = holed(recording, *((0.5 * k + 0.3, 0.5 * k + 0.5) for k in range(16)))
    little = with_cuts_told(load_dataset(torn, STAGE, "bag", allow_gaps=True)).problems[-1]
    assert little.startswith("only ")
    whole = load_dataset(stage_recording(seed=4, seconds=4.0), STAGE, "bag")
    assert with_cuts_told(whole) is whole


def test_the_command_cuts_without_being_asked(tmp_path, monkeypatch):
    recording = holed(stage_recording(seed=5, seconds=6.0), (3.0, 3.02))
    write_recording(tmp_path / "bag", recording.topics, {}, {})
    dataset = load(str(tmp_path / "bag"), STAGE)
    assert any("cut apart at its holes" in p for p in dataset.problems)
    assert (
        command._parser()
        .parse_args(
            [*["--model", "m", "--estimation", "a", "--validation", "b", "--output", "c"], "--allow-gaps"]
        )
        .allow_gaps
    )


def test_more_samples_than_memory_holds_are_refused_before_they_are_read(tmp_path):
    recording = stage_recording(seed=5, seconds=2.0)
    write_recording(tmp_path / "bag", recording.topics, {}, {})
    refuse_too_long([str(tmp_path / "bag")], STAGE)
    path = tmp_path / "bag" / "metadata.yaml"
    content = yaml.safe_load(path.read_text(encoding="utf-8"))
    for topic in content["rosbag2_bagfile_information"]["topics_with_message_count"]:
        topic["message_count"] = 10_000_000
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    for storage in (tmp_path / "bag").glob("*.mcap"):
        storage.write_bytes(b"not to be read")
    with pytest.raises(RecordingError, match=r"10000000 samples.*at most 800000 .*ros2 bag convert"):
        refuse_too_long([str(tmp_path / "bag")], STAGE)
