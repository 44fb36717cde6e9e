"""`import --suggest` tries its own proposal, mends what headers have wrong, and goes by values where names
say nothing."""

import numpy as np
import pytest
import scipy.io
from joint_bags import joint_bag
from joint_logs import machine, table

from haptic_teleop_control.recording import read_recording
from haptic_teleop_sim.model import load_model
from haptic_teleop_sysid.commands.import_log import main
from haptic_teleop_sysid.commands.model_from_log import main as model_main
from haptic_teleop_sysid.logs.opened import open_recording

T, TORQUE, ANGLE, SPEED = machine()
STATES = "/plant/joint_states"
HEADER = ("time [s]", "torque [Nm]", "q [rad]", "dq [rad/s]")


def suggested(log, tmp_path, capsys):
    """(mapping as text, what was said) of a proposal."""
    capsys.readouterr()
    assert main([str(log), "--suggest"]) == 0
    captured = capsys.readouterr()
    (tmp_path / "suggested.yaml").write_text(captured.out)
    return captured.out, " ".join(captured.err.split())


def filled_in(tmp_path, **units):
    """The proposal with the inputs' units filled in: a path to it."""
    path = tmp_path / "filled.yaml"
    path.write_text((tmp_path / "suggested.yaml").read_text().replace("unit: FILL IN", "unit: N*m"))
    return path


@pytest.mark.parametrize(
    ("columns", "told"),
    [
        ((T, TORQUE, np.degrees(ANGLE), SPEED), "unit: deg}  # guessed"),
        ((T, TORQUE, ANGLE, np.degrees(SPEED)), "unit: deg/s}  # guessed"),
        ((T, TORQUE, ANGLE, SPEED * 30.0 / np.pi), "unit: rpm}  # guessed"),
        ((T, TORQUE, ANGLE, -SPEED), "sign: -1}  # guessed"),
    ],
)
def test_what_a_header_has_wrong_is_said_and_mended_in_the_proposal(tmp_path, capsys, columns, told):
    log = table(tmp_path / "log.csv", HEADER, columns)
    assert main([str(log), "--output", str(tmp_path / "bag")]) == 2
    out, said = suggested(log, tmp_path, capsys)
    assert "nothing is open" not in said and "by the headers alone it is refused" in said
    assert told in out
    states = open_recording(log, tmp_path / "suggested.yaml").topics[STATES]
    assert np.allclose(states.signal("joint", "position"), ANGLE, atol=1e-6)
    assert np.allclose(states.signal("joint", "velocity"), SPEED, atol=1e-6)


def test_a_proposal_that_import_would_refuse_says_so_and_why(tmp_path, capsys):
    counts = np.rint(1000.0 * ANGLE)
    log = table(tmp_path / "log.csv", ("time [s]", "torque [Nm]", "enc [counts]"), (T, TORQUE, counts))
    out, said = suggested(log, tmp_path, capsys)
    assert "not to be imported as it stands" in said and "counts_per_turn: FILL IN" in out
    assert "# Not to be imported as it stands" in out
    twice = table(tmp_path / "twice.csv", HEADER, (np.r_[T[:700], T[:800]], TORQUE, ANGLE, SPEED))
    assert "the time starts anew at row 701" in suggested(twice, tmp_path, capsys)[1]


@pytest.mark.parametrize("kind", ["csv", "npy", "mat"])
def test_columns_without_names_go_by_their_values(tmp_path, capsys, kind):
    rng = np.random.default_rng(3)
    columns = (T, rng.normal(size=len(T)), SPEED, TORQUE, np.degrees(ANGLE))
    if kind == "csv":
        log = table(tmp_path / "log.csv", (), columns)
    elif kind == "npy":
        log = tmp_path / "log.npy"
        np.save(log, np.column_stack(columns))
    else:
        log = tmp_path / "log.mat"
        cell = np.empty((1, len(columns)), dtype=object)
        cell[0, :] = columns
        scipy.io.savemat(log, {"c": cell})
    out, said = suggested(log, tmp_path, capsys)
    assert "go together (correlation 1.0000)" in out and "# likely: motor position" in out
    assert "# missing: input by its values" in out and "not to be imported as it stands" in said
    states = open_recording(log, filled_in(tmp_path)).topics[STATES]
    assert np.allclose(states.signal("joint", "position"), ANGLE, atol=1e-6)
    assert np.allclose(states.signal("joint", "velocity"), SPEED, atol=1e-6)
    assert np.allclose(states.signal("joint", "effort"), TORQUE, atol=1e-6)


def test_a_position_alone_is_told_from_its_input_by_the_equation_of_motion(tmp_path, capsys):
    rng = np.random.default_rng(4)
    for columns in ((T, TORQUE, ANGLE), (T, ANGLE, TORQUE)):
        rough = [c + (2e-5 * rng.normal(size=len(T)) if c is ANGLE else 0.0) for c in columns]
        log = table(tmp_path / "log.csv", (), rough)
        out, _ = suggested(log, tmp_path, capsys)
        assert "# guessed: motor position by its values" in out
        states = open_recording(log, filled_in(tmp_path)).topics[STATES]
        assert np.allclose(states.signal("joint", "effort"), TORQUE, atol=1e-6)
    noise = table(tmp_path / "noise.csv", (), (T, *rng.normal(size=(2, len(T)))))
    assert "joints: {}" in suggested(noise, tmp_path, capsys)[0]


def test_joints_without_names_keep_their_own_velocities_and_inputs(tmp_path, capsys):
    longer = machine(2000)
    one, two = ([c[k : k + 1500] for c in longer[1:]] for k in (0, 500))
    log = table(tmp_path / "log.csv", (), (T, *(0.5 * c for c in one), *(np.degrees(c) for c in two)))
    out, _ = suggested(log, tmp_path, capsys)
    first, second = out.split("  j1:")[1].split("  j2:")
    for block, (drive, position, velocity) in ((first, (2, 3, 4)), (second, (5, 6, 7))):
        assert f'position: {{column: "{position}"' in block and f'velocity: {{column: "{velocity}"' in block
        assert f'input: {{column: "{drive}"' in block


def test_a_wrench_is_no_input_that_a_proposal_is_sure_of(tmp_path, capsys):
    wrench = np.zeros((len(T), 6))
    wrench[:, 0] = 4.0
    wrench[:, 5] = TORQUE
    joints = {"elbow": (ANGLE, SPEED, None)}
    out, _ = suggested(joint_bag(tmp_path / "log", T, joints, wrench=wrench), tmp_path, capsys)
    assert 'input: {column: "/ft:wrench.torque.z"}  # guessed' in out
    states = open_recording(tmp_path / "log", tmp_path / "suggested.yaml")
    assert np.array_equal(states.topics[STATES].signal("elbow", "position"), ANGLE)  # rad, no metres


@pytest.mark.parametrize("kind", ["ros1", "MCAP"])
def test_a_bag_of_joint_states_is_taken_by_import_and_by_model_alike(tmp_path, kind):
    bag = tmp_path / ("log.bag" if kind == "ros1" else "log")
    joints = {"m": (ANGLE, SPEED, TORQUE), "deg": (2.0 * ANGLE, 2.0 * SPEED, TORQUE)}
    joint_bag(bag, T, joints, kind)
    assert main([str(bag), "--output", str(tmp_path / "bag")]) == 0
    recording = read_recording(tmp_path / "bag")
    assert recording.experiment["import"]["units"]["m"] == {
        "position": "rad", "velocity": "rad/s", "input": "N*m",
    }  # fmt: skip
    assert np.array_equal(recording.topics[STATES].signal("deg", "position"), 2.0 * ANGLE)
    assert "REP 103" in " ".join(recording.experiment["import"]["changes"])
    for source, name in ((bag, "direct"), (tmp_path / "bag", "imported")):
        assert model_main(["--from", str(source), "--output", str(tmp_path / f"{name}.yaml")]) == 0
    direct, imported = (load_model(tmp_path / f"{n}_deg.yaml").parameters for n in ("direct", "imported"))
    assert direct == pytest.approx(imported, rel=1e-9)


def test_joint_states_in_degrees_are_refused_and_mended_by_their_names(tmp_path, capsys):
    wrench = np.column_stack([np.sin(T), *np.zeros((5, len(T)))])  # its columns come first
    bag = joint_bag(tmp_path / "log", T, {"a": (np.degrees(ANGLE), SPEED, TORQUE)}, wrench=wrench)
    assert main([str(bag), "--output", str(tmp_path / "bag")]) == 2
    assert "unit: deg}  # guessed" in suggested(bag, tmp_path, capsys)[0]
    states = open_recording(bag, tmp_path / "suggested.yaml").topics[STATES]
    assert np.allclose(states.signal("a", "position"), ANGLE, atol=1e-9)


def test_two_columns_of_the_same_time_are_told(tmp_path, capsys):
    header = ("time [s]", "stamp [ms]", *HEADER[1:])
    log = table(tmp_path / "log.csv", header, (T, 1e3 * T, TORQUE, ANGLE, SPEED), digits=12)
    assert "tell the same time" in suggested(log, tmp_path, capsys)[1]
    assert "tell the same time" in " ".join(open_recording(log).experiment["import"]["changes"])
