"""`model` gives a model with the parameters of the machine that the log is of, or says what it lacks."""

import hashlib

import numpy as np
import pytest
from joint_logs import DAMPING, INERTIA, machine, plain_table, table
from joint_recordings import DT, TRUTH, response

from haptic_teleop_sim.model import load_model
from haptic_teleop_sysid.commands import estimate
from haptic_teleop_sysid.commands.model_from_log import main
from haptic_teleop_sysid.logs.opened import open_recording
from haptic_teleop_sysid.recordings.dataset import load_dataset
from haptic_teleop_sysid.recordings.encoder_zeros import arm_zero
from haptic_teleop_sysid.simulation.fit import simulated_fit

TIME = 0.002 * np.arange(6000)
HEADER = ("time [s]", "torque [Nm]", "angle [rad]")


def motion(amplitude=1.0):
    """A motion (n,) whose velocity and acceleration are known exactly."""
    lines = [(amplitude, 0.5, 0.3), (0.4 * amplitude, 1.3, 1.0), (0.1 * amplitude, 2.9, 2.0)]
    w = 2 * np.pi
    angle = sum(a * np.sin(w * f * TIME + p) for a, f, p in lines)
    speed = sum(a * w * f * np.cos(w * f * TIME + p) for a, f, p in lines)
    return angle, speed, sum(-a * (w * f) ** 2 * np.sin(w * f * TIME + p) for a, f, p in lines)


def made(log, tmp_path, *options):
    assert main(["--from", str(log), "--output", str(tmp_path / "model.yaml"), *options]) == 0
    return load_model(tmp_path / "model.yaml")


def test_a_rigid_body_has_the_inertia_and_damping_of_the_machine(tmp_path, capsys):
    log = plain_table(tmp_path / "log.csv")
    model = made(log, tmp_path)
    assert (model.robot, model.structure, model.fixed) == ("generic", "rigid_body", ("torque_constant",))
    assert model.parameters["motor_inertia"] == pytest.approx(INERTIA, rel=0.02)
    assert model.parameters["motor_damping"] == pytest.approx(DAMPING, rel=0.02)
    # It names the topics: the log can be simulated at once.
    fit = simulated_fit(model, load_dataset(open_recording(log), model))
    assert fit.percent["joint_motor.position"] > 98.0
    said = capsys.readouterr().out
    assert float(said.split("fit of the input: ")[1].split(" %")[0]) > 90.0


def test_a_flexible_joint_is_seen_and_has_all_its_parameters(tmp_path):
    log = flexible_log(tmp_path / "log.csv")
    model = made(log, tmp_path)
    assert model.structure == "flexible_joint"
    for name in ("stiffness", "motor_damping", "arm_inertia"):
        assert model.parameters[name] == pytest.approx(TRUTH[name], rel=0.05), name
    assert model.parameters["motor_inertia"] == pytest.approx(TRUTH["motor_inertia"], rel=0.2)
    assert made(log, tmp_path, "--structure", "rigid_body", "--overwrite").rigid


def flexible_log(path, zero=0.0):
    """The log of a flexible joint whose arm's encoder reads ``zero`` rad where the motor's reads none."""
    rng = np.random.default_rng(1)
    t = DT * np.arange(15_000)
    lines = [(f, rng.uniform(0, 6)) for f in (0.4, 0.7, 0.9, 1.3, 1.9, 2.9)]
    current = 0.1 * sum(np.sin(2 * np.pi * f * t + p) for f, p in lines)
    states = response(current)
    header = ("time [s]", "torque [Nm]", "motor angle [rad]", "arm angle [rad]")
    return table(path, header, (t, 8.925 * current, states[:, 0], states[:, 1] + zero), digits=12)


@pytest.mark.parametrize("zero", [np.pi / 2, -700.0])
def test_encoders_that_count_from_different_zeros_are_told_and_change_nothing_else(tmp_path, capsys, zero):
    same = made(flexible_log(tmp_path / "same.csv"), tmp_path)
    assert "different zeros" not in capsys.readouterr().out
    other = made(flexible_log(tmp_path / "log.csv", zero), tmp_path, "--overwrite")
    assert other.parameters == pytest.approx(same.parameters, rel=0.02)
    log = open_recording(tmp_path / "log.csv")
    data = load_dataset(log, other)
    (told,) = [p for p in data.problems if "different zeros" in p]
    assert float(told.split("zeros: ")[1].split(" rad")[0]) == pytest.approx(zero, abs=2e-3)
    assert simulated_fit(other, data).percent["joint_arm.position"] > 95.0


def test_a_deflection_that_the_motor_holds_is_the_joint_s(tmp_path):
    """A weight at the arm bends the spring all the time: no other zero."""
    log = flexible_log(tmp_path / "log.csv")
    model = made(log, tmp_path)
    data = load_dataset(open_recording(log), model)
    held = 2.0  # N·m at both ends of the spring
    bent = held / model.parameters["stiffness"]
    valid = np.ones(len(data), dtype=bool)
    found = arm_zero(data.motor_position, data.arm_position - bent, data.input + held, valid, data.dt, model)
    assert found == 0.0 and abs(np.mean(data.motor_position - data.arm_position + bent)) > 0.4


def test_an_arm_that_does_not_move_by_itself_makes_no_flexible_joint(tmp_path, capsys):
    t, torque, angle, _ = machine()
    header = ("time [s]", "torque [Nm]", "motor angle [rad]", "arm angle [rad]")
    log = table(tmp_path / "log.csv", header, (t, torque, angle, angle + 1e-6 * np.sin(t)))
    assert made(log, tmp_path).structure == "rigid_body"
    assert "does not move against its motor" in capsys.readouterr().out


def test_dry_friction_is_told_beside_the_structure(tmp_path, capsys):
    angle, speed, acceleration = motion()
    torque = 0.2 * acceleration + 0.5 * speed + 1.0 * np.sign(speed) + 0.1
    model = made(table(tmp_path / "log.csv", HEADER, (TIME, torque, angle)), tmp_path)
    assert model.parameters["motor_inertia"] == pytest.approx(0.2, rel=0.1)
    out = capsys.readouterr().out
    told = next(line for line in out.splitlines() if "dry friction" in line)
    size = float(told.split("dry friction ")[1].split(",")[0])
    assert size == pytest.approx(1.0, rel=0.1)
    assert "a constant 0." in told


def test_gravity_does_not_become_inertia(tmp_path, capsys):
    angle, speed, acceleration = motion(1.2)
    torque = 0.05 * acceleration + 0.1 * speed + 3.0 * np.sin(angle)
    model = made(table(tmp_path / "log.csv", HEADER, (TIME, torque, angle)), tmp_path)
    assert model.parameters["motor_inertia"] == pytest.approx(0.05, rel=0.05)
    out = capsys.readouterr().out
    assert "gravity (sine)" in out and "which the model lacks" in out


def test_what_explains_nearly_all_is_preferred_to_what_explains_half(tmp_path):
    """An inertia alone follows half of this pull over small angles, ten times too large."""
    angle, speed, acceleration = motion(0.4)
    torque = 0.05 * acceleration + 1.0 * speed + 2.0 * np.cos(angle + 0.8)
    model = made(table(tmp_path / "log.csv", HEADER, (TIME, torque, angle)), tmp_path)
    assert model.parameters["motor_inertia"] == pytest.approx(0.05, rel=0.1)
    assert model.parameters["motor_damping"] == pytest.approx(1.0, rel=0.05)


def test_dry_friction_never_drives(tmp_path, capsys):
    angle, speed, acceleration = motion()
    torque = 0.2 * acceleration + 0.5 * speed - 0.3 * np.sign(speed)
    made(table(tmp_path / "log.csv", HEADER, (TIME, torque, angle)), tmp_path)
    assert "dry friction -" not in capsys.readouterr().out


def test_a_slow_joint_gets_the_inertia_that_it_may_have_at_most(tmp_path, capsys):
    rng = np.random.default_rng(5)
    angle, speed, _ = (0.02**k * one for k, one in enumerate(motion()))
    slow = 50.0 * TIME  # the same motion, fifty times slower
    torque = 0.3 * np.sign(speed) + 0.03 * rng.normal(size=len(slow))
    log = table(tmp_path / "log.csv", HEADER, (slow, torque, angle))
    model = made(log, tmp_path)
    assert "the inertia does not show in this motion: it is below about" in capsys.readouterr().out
    assert model.parameters["motor_inertia"] > 0.0


def test_a_late_encoder_leaves_no_damping_from_which_a_search_gets_nowhere(tmp_path, capsys):
    """The fit had no damping at all, and a diagnosis, which goes up to eight times the model's, named nothing
    right."""
    angle, speed, acceleration = motion()
    late = round(0.06 / (TIME[1] - TIME[0]))
    shown = np.concatenate([np.full(late, angle[0]), angle[:-late]])
    torque = INERTIA * acceleration + DAMPING * speed
    log = table(tmp_path / "log.csv", HEADER, (TIME, torque, shown))
    model = made(log, tmp_path)
    assert "hardly seen in this motion: the model has 5 %" in capsys.readouterr().out
    least = 0.05 * np.std(torque) / np.std(speed)
    assert model.parameters["motor_damping"] == pytest.approx(least, rel=0.2)


def test_a_linear_axis_and_an_input_in_ampere_have_their_units(tmp_path, capsys):
    t, torque, angle, _ = machine()
    header = ("time [s]", "force [N]", "x [mm]")
    made(table(tmp_path / "log.csv", header, (t, torque, 1e3 * angle)), tmp_path)
    assert " kg\n" in capsys.readouterr().out
    header = ("time [s]", "current [A]", "angle [rad]")
    made(table(tmp_path / "log.csv", header, (t, torque, angle)), tmp_path, "--overwrite")
    out = capsys.readouterr().out
    assert "per A of it" in out and " A·s²/rad\n" in out


def test_every_joint_of_a_log_gets_its_model(tmp_path, capsys):
    t, torque, angle, _ = machine()
    header = (
        "time [s]",
        "torque1 [Nm]",
        "angle1 [rad]",
        "torque2 [Nm]",
        "angle2 [rad]",
        "torque3 [Nm]",
        "angle3 [rad]",
    )
    columns = (t, torque, angle, 2.0 * torque, angle, 0.0 * torque, 0.0 * angle)
    log = table(tmp_path / "log.csv", header, columns)
    assert main(["--from", str(log), "--output", str(tmp_path / "m.yaml")]) == 1
    first, second = (load_model(tmp_path / f"m_{j}.yaml").parameters["motor_inertia"] for j in ("j1", "j2"))
    assert second == pytest.approx(2.0 * first, rel=1e-6)
    assert "failed: j3" in capsys.readouterr().err and not (tmp_path / "m_j3.yaml").exists()


def test_what_gives_no_model_is_refused_in_one_sentence(tmp_path, capsys):
    t, torque, angle, _ = machine()
    wrong = table(tmp_path / "wrong.csv", HEADER, (t, -torque, angle))
    good = plain_table(tmp_path / "good.csv")
    slow = table(tmp_path / "slow.csv", HEADER, (1e3 * t, torque, angle))
    quick = table(tmp_path / "quick.csv", HEADER, (1e-3 * t, torque, angle))
    (tmp_path / "there.yaml").write_text("mine")
    new = str(tmp_path / "new.yaml")
    for argv, said in (
        (["--from", str(wrong), "--output", new], "check sign"),
        (["--from", str(slow), "--output", new], "is the time in another unit"),
        (["--from", str(quick), "--output", new], "is the time in another unit"),
        (["--from", str(good), "--output", new, "--structure", "flexible_joint"], "no recorded arm"),
        (["--from", str(good), "--output", new, "--joint", "knee"], "no joint 'knee'"),
        (["--from", str(good), "--output", str(tmp_path / "there.yaml")], "--overwrite"),
    ):
        assert main(argv) == 2
        assert said in capsys.readouterr().err
    assert (tmp_path / "there.yaml").read_text() == "mine" and not (tmp_path / "new.yaml").exists()


def test_what_looks_odd_in_a_log_is_said_before_its_numbers(tmp_path, capsys):
    t, torque, angle, velocity = machine()
    header = ("time [s]", "torque [Nm]", "angle [rad]", "velocity [rad/s]")
    # Degrees under the name of radians, in both: that one is the other's derivative says nothing of it.
    far = 30.0 / np.ptp(angle)
    log = table(tmp_path / "log.csv", header, (t, torque, far * angle, far * velocity))
    main(["--from", str(log), "--output", str(tmp_path / "model.yaml")])
    assert "are these degrees?" in " ".join(capsys.readouterr().err.split())


def test_a_model_file_says_what_it_is_from_and_what_to_know_of_it(tmp_path):
    angle, speed, acceleration = motion(1.2)
    torque = 0.05 * acceleration + 0.1 * speed + 3.0 * np.sin(angle)
    log = table(tmp_path / "log.csv", HEADER, (TIME, torque, angle))
    made(log, tmp_path)
    lines = (tmp_path / "model.yaml").read_text().splitlines()
    above = lines[: lines.index("haptic_teleop_model: 1")]
    assert above and all(line.startswith("# ") for line in above)
    said = " ".join(above)
    assert f"from log.csv, SHA-256 {hashlib.sha256(log.read_bytes()).hexdigest()}" in said
    assert "no estimate" in said and "which the model lacks" in said and "fit of the input" in said


def test_the_bounds_in_a_model_file_can_be_given_to_estimate_as_they_stand(tmp_path):
    log = plain_table(tmp_path / "log.csv")
    model = made(log, tmp_path)
    text = (tmp_path / "model.yaml").read_text().splitlines()
    bounds = next(line for line in text if "--bound" in line).split("--bound ")[1].split()
    assert [b.split("=")[0] for b in bounds] == ["motor_inertia", "motor_damping"]
    for bound in bounds:
        name, span = bound.split("=")
        low, high = map(float, span.split(":"))
        assert low < model.parameters[name] < high
    argv = ["--model", str(tmp_path / "model.yaml"), "--bag", str(log), "--output", str(tmp_path / "out")]
    assert estimate.main([*argv, "--bound", *bounds]) == 0
