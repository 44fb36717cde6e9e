"""`import` makes the recording that the log was of, says what it changed, and guesses nothing silently."""

import hashlib
import json
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from joint_logs import DAMPING, HEADER, INERTIA, machine, mapping_file, plain_table, table
from log_bags import bag

from haptic_teleop_control.errors import ConfigurationError, MismatchError, RecordingError
from haptic_teleop_control.recording import read_recording
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.commands import compare, dataset_report, diagnose
from haptic_teleop_sysid.commands.import_log import main
from haptic_teleop_sysid.logs.opened import open_recording
from haptic_teleop_sysid.recordings.dataset import load_dataset
from haptic_teleop_sysid.runs.estimation_run import Choices, load

T, TORQUE, ANGLE, SPEED = machine()
DATA = (1e3 * T, 1e3 * TORQUE, np.degrees(ANGLE))
STATES = "/plant/joint_states"


def model(joint="joint", arm=False):
    io = {
        "input": {"topic": STATES, "joint": joint, "field": "effort"},
        "motor": {"topic": STATES, "joint": joint},
        "arm": {"topic": STATES, "joint": f"{joint}_arm"} if arm else None,
    }
    parameters = {"torque_constant": 1.0, "motor_inertia": INERTIA, "motor_damping": DAMPING}
    if arm:
        parameters |= {"stiffness": 1.0, "arm_inertia": 0.1, "arm_damping": 0.1}
    structure = "flexible_joint" if arm else "rigid_body"
    return Model("generic", joint, structure, parameters, fixed=("torque_constant",), io=io)


def opened(path, tmp_path, text):
    return open_recording(path, mapping_file(tmp_path / "mapping.yaml", text))


def notes(recording):
    return " ".join(recording.problems)


def test_a_log_whose_header_leaves_nothing_open_becomes_the_recording_that_it_was_of(tmp_path):
    log = plain_table(tmp_path / "log.csv", delimiter=";", decimal=",")
    assert main([str(log), "--output", str(tmp_path / "bag")]) == 0
    recording = read_recording(tmp_path / "bag")
    data = load_dataset(recording, model())
    assert recording.complete and not recording.problems
    assert np.allclose(data.time, T, atol=1e-9)
    assert np.allclose(data.input, TORQUE, atol=1e-8)
    assert np.allclose(data.motor_position, ANGLE, atol=1e-8)
    assert np.allclose(data.motor_velocity[20:-20], SPEED[20:-20], atol=0.01 * np.ptp(SPEED))


def test_the_recording_tells_what_it_was_made_of_and_how(tmp_path):
    log = plain_table(tmp_path / "log.csv")
    main([str(log), "--output", str(tmp_path / "bag")])
    story = read_recording(tmp_path / "bag").experiment["import"]
    assert story["sha256"] == hashlib.sha256(log.read_bytes()).hexdigest()
    assert story["file"] == "log.csv"
    assert story["mapping"]["joints"]["joint"]["motor"]["position"] == {"column": "angle [deg]"}
    assert story["units"] == {"joint": {"position": "rad", "velocity": "rad/s", "input": "N*m"}}
    changes = " ".join(story["changes"])
    assert all(text in changes for text in ("times 0.001 is N*m", "times 0.01745329252 is rad", "time [ms]"))
    assert "zero" not in changes, "that no date is known is nobody's concern"


def test_a_log_and_its_recording_are_one_data_set(tmp_path):
    log = plain_table(tmp_path / "log.csv")
    main([str(log), "--output", str(tmp_path / "bag")])
    direct, imported = (load_dataset(open_recording(p), model(), "x") for p in (log, tmp_path / "bag"))
    for name in ("time", "input", "motor_position", "motor_velocity", "valid"):
        assert np.array_equal(getattr(direct, name), getattr(imported, name)), name
    assert direct.problems == imported.problems


def test_counts_gains_signs_and_numbers_of_columns_are_mapped(tmp_path):
    columns = (T * 1e6, -TORQUE / 0.36, np.rint(ANGLE / (2 * np.pi) * 65536), SPEED * 60 / (2 * np.pi))
    log = table(tmp_path / "log.tsv", (), columns, "\t", digits=12)
    recording = opened(log, tmp_path, """
time: {column: 1, unit: us}
joints:
  elbow:
    input: {column: 2, unit: V, gain: 0.36, gain_unit: N*m/V, sign: -1}
    motor:
      position: {column: 3, unit: counts, counts_per_turn: 65536}
      velocity: {column: 4, unit: rpm}
""")  # fmt: skip
    data = load_dataset(recording, model("elbow"))
    assert np.allclose(data.input, TORQUE, atol=1e-9)
    assert np.allclose(data.motor_position, ANGLE, atol=np.pi / 65536 + 1e-12)
    assert np.allclose(data.motor_velocity, SPEED, atol=1e-9)


def test_a_table_without_time_takes_the_rate_of_its_mapping(tmp_path):
    log = table(tmp_path / "log.csv", ("torque [Nm]", "angle [rad]"), (TORQUE, ANGLE))
    recording = opened(log, tmp_path, """
time: {rate: 500}
joints: {j: {input: {column: torque}, motor: {position: {column: angle}}}}
""")  # fmt: skip
    assert np.allclose(load_dataset(recording, model("j")).time, T, atol=1e-9)


def test_a_joint_with_an_arm_and_a_second_joint_keep_their_names(tmp_path):
    header = ("time [s]", "motor1 [deg]", "link1 [deg]", "torque1 [Nm]", "motor2 [rad]", "torque2 [Nm]")
    columns = (T, np.degrees(ANGLE), np.degrees(0.9 * ANGLE), TORQUE, 0.5 * ANGLE, 2.0 * TORQUE)
    recording = open_recording(table(tmp_path / "log.csv", header, columns))
    assert recording.topics[STATES].names == ("j1", "j1_arm", "j2")
    first = load_dataset(recording, model("j1", arm=True))
    assert first.arm_position is not None and np.allclose(first.arm_position, 0.9 * ANGLE, atol=1e-8)
    assert np.allclose(load_dataset(recording, model("j2")).input, 2.0 * TORQUE, atol=1e-8)
    assert not first.problems  # the arm has no effort, and was never meant to have one


def test_a_velocity_alone_is_integrated_and_that_is_said(tmp_path):
    log = table(
        tmp_path / "log.csv", ("t [s]", "torque [Nm]", "speed [rpm]"), (T, TORQUE, SPEED * 30 / np.pi)
    )
    recording = open_recording(log)
    data = load_dataset(recording, model())
    assert np.allclose(data.motor_velocity, SPEED, atol=1e-7)
    assert np.allclose(data.motor_position, ANGLE - ANGLE[0], atol=2e-3 * np.ptp(ANGLE))
    assert "integral" in " ".join(recording.experiment["import"]["changes"])


def test_a_linear_axis_has_metres_and_newtons(tmp_path):
    log = table(tmp_path / "log.csv", ("t [s]", "force [N]", "x [mm]"), (T, 40.0 * TORQUE, 100.0 * ANGLE))
    data = load_dataset(open_recording(log), model())
    assert np.allclose(data.motor_position, 0.1 * ANGLE, atol=1e-9)
    assert data.units() == {"joint_motor.position": "m", "joint_motor.velocity": "m/s"}
    assert data.input_unit == "N"


def test_a_bag_takes_its_input_from_another_topic(tmp_path):
    recording = opened(bag(tmp_path / "log.bag", "ros1"), tmp_path, """
joints:
  elbow:
    input: {column: "/ft:wrench.torque.z"}
    motor: {position: {column: "/joint_states:position[elbow]", unit: rad},
            velocity: {column: "/joint_states:velocity[elbow]", unit: rad/s}}
""")  # fmt: skip
    io = recording.experiment["import"]["io"]["elbow"]
    data = load_dataset(recording, Model(**{**model("elbow").__dict__, "io": io}))
    assert np.array_equal(data.motor_position, ANGLE[:60])
    assert np.array_equal(data.input, TORQUE[:60])
    assert recording.topics[STATES].stamp[0] == 50 * 10**9


# --- what is odd -------------------------------------------------------------------------------------------


def test_a_bag_is_not_read_by_a_mapping_for_tables(tmp_path):
    mapping = mapping_file(tmp_path / "m.yaml", "time: t\njoints: {j: {motor: {position: q}}}\n")
    with pytest.raises(ConfigurationError, match="names no topic"):
        open_recording(bag(tmp_path / "log.bag", "ros1"), mapping)


def test_what_headers_leave_open_is_not_guessed(tmp_path):
    for header in (
        ("t", "u", "q"),
        ("time [ms]", "torque", "angle [deg]"),
        ("time", "torque [Nm]", "angle [deg]"),
    ):
        with pytest.raises(ConfigurationError, match=r"leave open.*--suggest"):
            open_recording(table(tmp_path / "log.csv", header, DATA))
    doubles = ((*HEADER, "angle2nd [deg]"), (*HEADER, "current [A]"), (*HEADER, "measured angle"))
    for header in doubles:
        with pytest.raises(ConfigurationError, match="leave open"):
            open_recording(table(tmp_path / "log.csv", header, (*DATA, DATA[2])))


def test_a_log_without_a_state_or_with_hardly_a_row_is_refused(tmp_path):
    for header, rows in ((("time [ms]", "torque [Nmm]", "status"), 100), (HEADER, 1), (("t", "tau", "q"), 1)):
        with pytest.raises((ConfigurationError, RecordingError)):
            open_recording(table(tmp_path / "log.csv", header, [c[:rows] for c in DATA]))


def test_set_points_and_columns_of_other_things_leave_nothing_open(tmp_path):
    header = (*HEADER, "angle_ref [deg]", "temperature [C]", "status")
    recording = open_recording(table(tmp_path / "log.csv", header, (*DATA, DATA[2] + 1.0, 20 + 0 * T, 0 * T)))
    assert np.allclose(recording.topics[STATES].signal("joint", "position"), ANGLE, atol=1e-8)
    assert "not needed: 'angle_ref [deg]'" in " ".join(recording.experiment["import"]["changes"])


def test_two_times_are_one_if_they_agree_and_a_question_if_not(tmp_path):
    header = ("time [ms]", "clock [s]", *HEADER[1:])
    agree = table(tmp_path / "agree.csv", header, (1e3 * T, 7.0 + T, *DATA[1:]))
    assert len(open_recording(agree).topics[STATES]) == len(T)
    other = table(
        tmp_path / "other.csv", ("time [ms]", "stamp [s]", *HEADER[1:]), (1e3 * T, 2 * T, *DATA[1:])
    )
    with pytest.raises(ConfigurationError, match="may each be the time"):
        open_recording(other)


def test_degrees_declared_as_radians_are_refused_by_the_velocity(tmp_path):
    header = ("t [s]", "torque [Nm]", "angle [rad]", "speed [rad/s]")
    log = table(tmp_path / "log.csv", header, (T, TORQUE, np.degrees(ANGLE), SPEED))
    with pytest.raises(MismatchError, match=r"57\.\d+ times as far.*degrees taken for radians"):
        open_recording(log)


def test_an_arm_in_another_unit_than_its_motor_is_refused(tmp_path):
    header = ("t [s]", "torque [Nm]", "motor [rad]", "link [rad]")
    log = table(tmp_path / "log.csv", header, (T, TORQUE, ANGLE, np.degrees(0.999 * ANGLE)))
    with pytest.raises(MismatchError, match=r"arm_position.*57\.\d+ times.*motor_position.*degrees"):
        open_recording(log)
    geared = table(tmp_path / "geared.csv", header, (T, TORQUE, 5.0 * ANGLE, ANGLE))
    assert "behind any gear" in notes(open_recording(geared))


def test_degrees_declared_as_radians_are_told_by_range_and_encoder_step(tmp_path):
    step = 360.0 / 4096
    degrees = step * np.rint(170.0 * np.sin(2 * np.pi * 0.5 * T) / step)
    log = table(
        tmp_path / "log.csv", ("t [s]", "torque [Nm]", "angle [rad]"), (T, TORQUE, degrees), digits=12
    )
    assert "are these degrees" in notes(recording := open_recording(log))
    assert "360/4096" in notes(recording)
    turns = table(tmp_path / "turns.csv", ("t [s]", "torque [Nm]", "angle [rad]"), (T, TORQUE, 1e4 * ANGLE))
    assert "degrees" not in notes(open_recording(turns))  # beyond one turn in degrees: it may well be radians


def test_a_motor_that_turns_far_in_steps_of_a_whole_turn_is_in_radians(tmp_path):
    step = 2.0 * np.pi / 4000
    header = ("t [s]", "torque [Nm]", "angle [rad]")
    motor = step * np.rint(60.0 * ANGLE / step)
    assert np.ptp(motor) > 4.0 * np.pi
    log = table(tmp_path / "motor.csv", header, (T, TORQUE, motor), digits=12)
    assert "degrees" not in notes(open_recording(log))
    coarse = 0.9 * np.rint(60.0 * ANGLE / 0.9)  # steps of 360/400
    log = table(tmp_path / "degrees.csv", header, (T, TORQUE, coarse), digits=12)
    assert "are these degrees" in notes(open_recording(log))


def test_milliseconds_declared_as_seconds_are_told_or_refused(tmp_path):
    header = ("t [s]", "torque [Nm]", "angle [rad]", "speed [rad/s]")
    log = table(tmp_path / "log.csv", header[:3], (1e3 * T, TORQUE, ANGLE))
    assert "is the time in another unit?" in notes(open_recording(log))
    log = table(tmp_path / "log.csv", header, (1e3 * T, TORQUE, ANGLE, SPEED))
    with pytest.raises(MismatchError, match="a thousandth taken for the whole unit"):
        open_recording(log)


def test_an_input_of_the_wrong_sign_is_told_and_the_right_one_is_not(tmp_path):
    right = table(tmp_path / "right.csv", ("t [s]", "torque [Nm]", "angle [rad]"), (T, TORQUE, ANGLE))
    wrong = table(tmp_path / "wrong.csv", ("t [s]", "torque [Nm]", "angle [rad]"), (T, -TORQUE, ANGLE))
    assert "sign" not in notes(open_recording(right))
    assert "is its sign reversed?" in notes(open_recording(wrong))


def test_a_velocity_against_its_position_is_refused(tmp_path):
    header = ("t [s]", "torque [Nm]", "angle [rad]", "speed [rad/s]")
    with pytest.raises(MismatchError, match="other sign"):
        open_recording(table(tmp_path / "log.csv", header, (T, TORQUE, ANGLE, -SPEED)))


def test_time_that_goes_back_or_has_holes_is_kept_and_told(tmp_path):
    back, holes = 1e3 * T, 1e3 * T
    back = np.concatenate([back[:500], back[500:] - 4.0])
    holes = np.concatenate([holes[:500], holes[500:] + 300.0])
    recording = open_recording(table(tmp_path / "back.csv", HEADER, (back, *DATA[1:])))
    assert "time goes back 1 time, first at row 501" in notes(recording)
    assert len(recording.topics[STATES]) == len(T)
    recording = open_recording(table(tmp_path / "holes.csv", HEADER, (holes, *DATA[1:])))
    assert "1 hole in time" in notes(recording) and "behind row 500" in notes(recording)
    with pytest.raises(RecordingError, match="--allow-gaps"):
        load_dataset(recording, model())


def test_several_recordings_in_one_file_are_refused_with_the_rows_of_the_first(tmp_path):
    again = np.concatenate([1e3 * T[:700], 1e3 * T[:800]])
    log = table(tmp_path / "log.csv", HEADER, (again, *DATA[1:]))
    with pytest.raises(RecordingError, match=r"starts anew at row 701.*--rows 1 700"):
        open_recording(log)
    assert main([str(log), "--rows", "1", "700", "--output", str(tmp_path / "bag")]) == 0
    assert len(read_recording(tmp_path / "bag").topics[STATES]) == 700


def test_a_time_written_too_coarsely_is_refused_with_the_remedy(tmp_path):
    log = table(tmp_path / "log.csv", ("t [s]", *HEADER[1:]), (np.floor(T * 100) / 100, *DATA[1:]))
    with pytest.raises(RecordingError, match="rate: HZ"):
        open_recording(log)


def test_text_in_a_column_is_passed_over_or_refused_where_it_is_needed(tmp_path):
    log = plain_table(tmp_path / "log.csv")
    lines = log.read_text().splitlines()
    log.write_text("\n".join([lines[0] + ",state", *(line + ",idle" for line in lines[1:])]))
    assert len(open_recording(log).topics[STATES]) == len(T)
    lines[42] = lines[42].rsplit(",", 1)[0] + ",broken"
    log.write_text("\n".join(lines))
    with pytest.raises(RecordingError, match=r"'angle \[deg\]' holds text, first 'broken' in line 43"):
        opened(log, tmp_path, "time: time\njoints: {j: {input: torque, motor: {position: angle}}}\n")


def test_units_that_contradict_each_other_are_refused_with_the_remedy(tmp_path):
    log = plain_table(tmp_path / "log.csv")
    entry = "time: time\njoints: {{j: {{input: {{column: {}}}, motor: {{position: {{column: {}}}}}}}}}\n"
    for drive, position, said in (
        ("torque", "angle, unit: rad", "says deg in the header"),
        ("torque", "torque", "is of torque, not of angle or length"),
        ("torque", "angle, gain: 1, gain_unit: m/deg", "its input is in Nmm"),
        ("torque", "3, unit: counts", "counts_per_turn"),
        ("torque", "angle, counts_per_turn: 5", "unit: counts"),
    ):
        with pytest.raises((ConfigurationError, MismatchError), match=said):
            opened(log, tmp_path, entry.format(drive, position))
    by_number = opened(log, tmp_path, entry.format("torque", "3, unit: rad"))  # a header that is wrong
    assert by_number.topics[STATES].position is not None
    both = (
        "time: time\n"
        "joints: {j: {input: torque, motor: {position: angle}, arm: {position: {column: 3, unit: mm}}}}\n"
    )
    with pytest.raises(ConfigurationError, match="turning and linear at once"):
        opened(log, tmp_path, both)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("joints: {j: {motor: {position: {unit: deg}}}}", r"joints\.j\.motor\.position names no column"),
        (
            "joints: {j: {motor: {position: nothing}}}\ntime: time",
            r"no column 'nothing'.*it has 'time \[ms\]'",
        ),
        ("joints: {j: {motor: {position: 9}}}\ntime: time", "columns 1 to 3, not 9"),
        ("joints: {j: {input: torque}}", "no motor.position and no motor.velocity"),
        ("joints: {j: {motor: {position: {column: 3, unit: furlong}}}}", "'furlong' is no unit"),
        ("joints: {j: {motor: {positon: 3}}}", "unknown key 'positon'"),
        ("joints: {j: {motor: {position: {column: 3, sign: 2}}}}", "give 1 or -1"),
        ("joints: {j: {motor: {position: {column: 3, gain: -2}}}}", "put the sign into sign"),
        ("joints: {j: {motor: {position: angle}}}", "does not say when"),
        ("joints: {j: {motor: {position: angle}}}\ntime: {rate: 0}", "sampling rate"),
        ("joints: {j: {motor: {position: angle}}}\ntime: {column: time, unit: deg}", "no unit of time"),
        ("joints: {}", "names no joint"),
        ("joints: {j: {motor: {position: angle}}, k: {motor: {position: }}}", "k.motor.position"),
        ("joints: [1", "line"),
    ],
)
def test_a_mapping_that_cannot_be_followed_is_refused_by_its_key(tmp_path, text, said):
    with pytest.raises(ConfigurationError, match=said):
        opened(plain_table(tmp_path / "log.csv"), tmp_path, text + "\n")


def test_a_table_with_dates_needs_no_unit_of_time(tmp_path):
    start = datetime(2026, 3, 1, tzinfo=UTC)
    rows = [
        f"{(start + timedelta(seconds=t)).isoformat()},{u},{q}" for t, u, q in zip(T, *DATA[1:], strict=True)
    ]
    (tmp_path / "log.csv").write_text("\n".join(["when,torque [Nmm],angle [deg]", *rows]))
    states = open_recording(tmp_path / "log.csv").topics[STATES]
    assert states.stamp[0] == int(start.timestamp()) * 10**9
    assert np.allclose(states.time(), T, atol=1e-6)


# --- the command -------------------------------------------------------------------------------------------


def test_one_broken_log_among_a_hundred_is_listed_and_the_others_go_on(tmp_path, capsys):
    text = plain_table(tmp_path / "log.csv").read_text().splitlines()[:61]
    folder = tmp_path / "logs"
    folder.mkdir()
    for i in range(100):
        (folder / f"log{i:02d}.csv").write_text(
            "\n".join(text[: 3 if i == 37 else None]) + ("\nx" * (i == 37))
        )
    assert main([str(folder), "--output", str(tmp_path / "bags")]) == 1
    captured = capsys.readouterr()
    assert "99 of 100 logs imported" in captured.out and "log37.csv" in captured.out
    assert captured.err.count("failed:") == 1
    assert len(list((tmp_path / "bags").iterdir())) == 99
    assert len(read_recording(tmp_path / "bags" / "log99").topics[STATES]) == 60


def test_nothing_that_exists_is_overwritten_and_nothing_is_left_of_a_refusal(tmp_path, capsys):
    log = plain_table(tmp_path / "log.csv")
    (tmp_path / "bag").mkdir()
    assert main([str(log), "--output", str(tmp_path / "bag")]) == 2
    assert "exists already" in capsys.readouterr().err
    bad = table(tmp_path / "bad.csv", ("t", "u"), (T, TORQUE))
    assert main([str(bad), "--output", str(tmp_path / "other")]) == 2
    assert not (tmp_path / "other").exists()
    for argv in (
        [str(log)],
        [str(log), "--rows", "5", "2", "--output", "x"],
        [str(log), str(bad), "--suggest"],
    ):
        assert main(argv) == 2
        assert capsys.readouterr().err.startswith("error: ")


def test_estimate_and_diagnose_take_a_log_as_it_is(tmp_path, capsys):
    log = str(plain_table(tmp_path / "log.csv"))
    data, _ = load([log], model(), Choices())
    assert np.allclose(data[log].motor_position, ANGLE, atol=1e-8)
    model().save(tmp_path / "model.yaml")
    other = table(tmp_path / "other.csv", ("time [ms]", "torque [Nmm]", "q"), DATA)  # the second is read, too
    argv = ["--model", str(tmp_path / "model.yaml"), "--estimation", log, "--validation", str(other)]
    assert diagnose.main([*argv, "--output", str(tmp_path / "out")]) == 2
    assert "other.csv: its headers leave open" in capsys.readouterr().err
    bare = str(table(tmp_path / "bare.csv", ("t", "u", "q"), DATA))
    with pytest.raises(ConfigurationError, match="--suggest"):
        load([bare], model(), Choices())
    mapping = mapping_file(
        tmp_path / "mapping.yaml",
        "time: {column: t, unit: ms}\n"
        "joints: {joint: {input: {column: u, unit: Nmm}, motor: {position: {column: q, unit: deg}}}}\n",
    )
    data, _ = load([bare], model(), Choices(mapping=str(mapping)))
    assert np.allclose(data[bare].input, TORQUE, atol=1e-8)


def test_dataset_and_compare_take_a_log_as_it_is(tmp_path, capsys):
    log = str(plain_table(tmp_path / "log.csv"))
    model().save(tmp_path / "model.yaml")
    assert dataset_report.main(["--bag", log, "--output", str(tmp_path / "look")]) == 0
    argv = ["--model", str(tmp_path / "model.yaml"), "--bag", log, "--output", str(tmp_path / "fit")]
    assert compare.main(argv) == 0
    fits = json.loads((tmp_path / "fit" / "compare.json").read_text())["fits"]
    # The model is the machine: what remains are nine written digits and the derivative of the angle.
    assert fits[str(tmp_path / "model.yaml")][log]["joint_motor.position"] > 99.9
    assert dataset_report.main(["--bag", log, "--mapping", "none.yaml", "--output", str(tmp_path / "x")]) == 2
