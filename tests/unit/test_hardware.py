"""The simulated robots seen from outside: what the drivers of the real ones would report and do."""

import math
from dataclasses import replace

import numpy as np
import pytest
from plants import flexible
from scipy import signal

from haptic_teleop_control.errors import ConfigurationError, ModelError
from haptic_teleop_control.robots import OMNI_RESOLUTION, SFJ_STAGES
from haptic_teleop_sim.default_models import sfj_stage_model
from haptic_teleop_sim.hardware import (
    OMNI_PARAMETERS,
    SFJ_PARAMETERS,
    OmniRobot,
    OmniSettings,
    SfjRobot,
    SfjSettings,
    StepResult,
    axis_hardware,
    stage_hardware,
)
from haptic_teleop_sim.model import Effect

DT = 0.002
FACTS = [SFJ_STAGES["stage1"], SFJ_STAGES["stage2"]]


def quiet(stage, **changes):
    """A stage without noise, offset and resolution of the current sense and the amplifier."""
    silent = {"sense_noise": 0.0, "sense_offset": 0.0, "sense_resolution": 0.0, "command_resolution": 0.0}
    return stage_hardware(stage, **{**silent, **changes})


def drive(robot, efforts):
    """What was sensed before each step, (n, 3, joints), the true states (n, joints, 4), and the results."""
    sensed, true, results = [], [], []
    for effort in efforts:
        sensed.append(np.array(robot.sense()))
        true.append(np.array([robot.plants.state(i)[:4] for i in range(len(robot.joints))]))
        results.append(robot.step(effort))
    return np.array(sensed), np.array(true), results


def sines(n=1000, joints=2):
    t = DT * np.arange(n)
    return np.column_stack([3.0 * np.sin(3.0 * t), 0.8 * np.sin(5.0 * t), 0.05 * np.sin(4.0 * t)])[:, :joints]


def test_positions_are_whole_counts_next_to_the_true_angle():
    sensed, true, _ = drive(SfjRobot(), sines())
    resolution = np.array([r for f in FACTS for r in (f.drive_resolution, f.joint_resolution)])
    counts = sensed[:, 0] / resolution
    np.testing.assert_allclose(counts, np.rint(counts), atol=1e-6)
    assert np.ptp(counts, axis=0).min() > 100
    error = sensed[:, 0] - true[:, :, :2].reshape(-1, 4)
    assert np.all(np.abs(error) <= 0.5 * resolution * (1 + 1e-9))


def test_velocities_are_those_of_the_40_hz_filter_on_the_reported_positions():
    sensed, _, _ = drive(SfjRobot(), sines())
    w = 2 * math.pi * 40.0
    system = signal.StateSpace(*signal.tf2ss([w * w, 0.0], [1.0, 2 * 0.9 * w, w * w]))
    for joint in range(4):
        # First-order hold: straight lines between the samples.
        _, expected, _ = signal.lsim(system, sensed[:, 0, joint], DT * np.arange(len(sensed)), interp=True)
        np.testing.assert_allclose(sensed[:, 1, joint], expected, atol=1e-9)


def test_the_effort_of_an_arm_is_the_stiffness_times_the_reported_deflection():
    sensed, _, _ = drive(SfjRobot(), sines())
    for stage, facts in enumerate(FACTS):
        position, effort = sensed[:, 0], sensed[:, 2]
        deflection = position[:, 2 * stage] - position[:, 2 * stage + 1]
        np.testing.assert_array_equal(effort[:, 2 * stage + 1], facts.stiffness * deflection)
        assert np.ptp(effort[:, 2 * stage + 1]) > 0.05


def test_the_effort_of_a_motor_is_the_current_that_the_last_command_made_flow():
    robot = SfjRobot(SfjSettings(quiet("stage1"), quiet("stage2")))
    efforts = sines(200)
    sensed, _, _ = drive(robot, efforts)
    np.testing.assert_allclose(sensed[1:, 2, [0, 2]], efforts[:-1], atol=1e-12)
    np.testing.assert_array_equal(sensed[0, 2, [0, 2]], 0.0)


def test_the_measured_current_has_the_offset_and_noise_of_the_amplifier_in_steps_of_the_converter():
    sensed, _, _ = drive(SfjRobot(), np.zeros((4000, 2)))
    for stage, (facts, offset) in enumerate(zip(FACTS, (-0.015, -0.02), strict=True)):
        current = sensed[:, 2, 2 * stage] / facts.torque_constant
        assert current.mean() == pytest.approx(offset, abs=5e-4)
        assert current.std() == pytest.approx(0.01, rel=0.05)
        steps = current / (20.0 / 2**14 * 2.0)
        np.testing.assert_allclose(steps, np.rint(steps), atol=1e-9)


def test_the_amplifier_gives_whole_steps_of_its_converter():
    robot = SfjRobot()
    wanted = 0.1234
    robot.step([wanted * 8.925, 0.0])
    step = 20.0 / 2**12 * 0.5
    assert robot.flow[0] / step == pytest.approx(round(wanted / step), abs=1e-9)
    assert robot.flow[0] != wanted


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_current_limit_holds(sign):
    robot = SfjRobot()
    assert robot.step([sign * 100.0, sign * 100.0]) == StepResult.LIMITED
    np.testing.assert_allclose(robot.flow, [sign * 0.94, sign * 1.2], atol=20.0 / 2**12 * 0.5)
    assert np.all(np.abs(robot.flow) <= [0.94, 1.2])
    assert robot.step([sign * 0.9 * 8.925, 0.0]) == StepResult.OK


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_command_that_is_not_finite_gives_no_current_and_is_reported(bad):
    robot = SfjRobot()
    robot.step([1.0, 0.2])
    assert StepResult.REFUSED_COMMAND in robot.step([bad, 0.2])
    assert robot.flow[0] == 0.0
    assert robot.flow[1] != 0.0
    assert np.all(np.isfinite(robot.plants.states))


def test_an_external_torque_that_is_not_finite_is_none():
    robot, twin = SfjRobot(), SfjRobot()
    for _ in range(10):
        robot.step([0.1, 0.1], [math.nan, math.inf])
        twin.step([0.1, 0.1])
    np.testing.assert_array_equal(robot.plants.states, twin.plants.states)


def test_a_model_that_cannot_be_simulated_is_reported_and_put_to_rest():
    runaway = flexible(motor_damping=-1e6)
    robot = SfjRobot(SfjSettings(stage1=stage_hardware("stage1", runaway)))
    results = [robot.step([0.5, 0.0]) for _ in range(200)]
    assert any(StepResult.DIVERGED in result for result in results)
    assert np.all(np.isfinite(np.array(robot.sense())))


def test_equal_seeds_give_equal_runs_and_different_ones_do_not():
    rough = {"disturbance_rms": 0.1}
    settings = SfjSettings(stage_hardware("stage1", **rough), stage_hardware("stage2", **rough))
    runs = [drive(SfjRobot(settings, seed=seed), sines(1500))[0] for seed in (7, 7, 8)]
    np.testing.assert_array_equal(runs[0], runs[1])
    assert not np.array_equal(runs[0][:, 0], runs[2][:, 0])


def test_noise_for_a_compiled_loop_is_the_noise_of_single_samples():
    one, many = SfjRobot(seed=3), SfjRobot(seed=3)
    single, _, _ = drive(one, np.zeros((1500, 2)))
    noise = many.take_noise(1200)
    measured = np.rint((-0.015 + 0.01 * noise[:, 0]) / (40.0 / 2**14)) * (40.0 / 2**14) * 8.925
    np.testing.assert_allclose(single[:1200, 2, 0], measured, atol=1e-12)
    rest, _, _ = drive(many, np.zeros((300, 2)))
    np.testing.assert_array_equal(rest[:, 2], single[1200:, 2])


def test_the_random_torque_has_its_size_and_colour():
    hardware = stage_hardware("stage1", disturbance_rms=0.2, disturbance_cutoff_hz=3.0)
    robot = SfjRobot(SfjSettings(stage1=hardware))
    torque = []
    for _ in range(60_000):
        robot.sense()
        robot.step([0.0, 0.0])
        torque.append(robot.plants.state(0)[-2])
    torque = np.array(torque)
    assert torque.std() == pytest.approx(0.2, rel=0.1)
    lag = 10
    correlation = np.corrcoef(torque[:-lag], torque[lag:])[0, 1]
    assert correlation == pytest.approx(math.exp(-2 * math.pi * 3.0 * lag * DT), abs=0.05)
    assert robot.plants.state(1)[-2] == 0.0


def test_the_stages_pull_at_each_other_where_a_model_says_so():
    coupling = Effect("inertial_coupling", "stage1_arm", {"coefficient": 0.02})
    coupled = sfj_stage_model("stage1").with_effects(coupling)
    robots = [SfjRobot(SfjSettings(stage1=stage_hardware("stage1", m))) for m in (coupled, None)]
    runs = [drive(robot, np.column_stack([np.zeros(300), 1.2 * np.ones(300)]))[1] for robot in robots]
    assert np.all(runs[1][:, 0] == 0.0)
    speed = runs[0][:, 1, 3]
    assert speed[100] > 0.5
    # While nothing has moved yet the first stage's arm takes the second one's momentum, times the
    # coefficient.
    assert runs[0][20, 0, 3] == pytest.approx(-0.02 * speed[19] / 0.17, rel=0.02)


# Parameters.


def test_the_defaults_of_the_table_are_the_default_robot():
    robot = SfjRobot.from_parameters({})
    assert robot.dt == DT
    for stage, hardware in zip(("stage1", "stage2"), robot.joints, strict=True):
        plain = stage_hardware(stage)
        assert hardware.row(DT) == plain.row(DT)
        stops = [e for e in hardware.model.effects if e.effect == "hard_stop"]
        assert [stop.location for stop in stops] == [f"{stage}_motor"]
    omni = OmniRobot.from_parameters({})
    assert omni.dt == 0.001
    assert [joint.command_limit for joint in omni.joints] == [0.446] * 3


def test_a_wall_stops_the_arm_and_lets_it_go():
    robot = SfjRobot.from_parameters({"stage1.wall.angle": 0.3, "stage1.wall.dissipation": 1.0})
    efforts = np.concatenate([np.full((2000, 2), [2.5, 0.0]), np.full((1500, 2), [-2.5, 0.0])])
    _, true, _ = drive(robot, efforts)
    arm = true[:, 0, 1]
    assert 0.3 < arm.max() < 0.3 + 0.012
    # At rest the wall carries the torque of the joint: motor torque less what friction may hold.
    carried = 3.971 * (true[1999, 0, 0] - arm[1999])
    assert 2000.0 * (arm[1999] - 0.3) == pytest.approx(carried, rel=0.02)
    assert arm[-1] < 0.0


def test_a_wall_on_the_negative_side_stops_the_other_motion():
    robot = SfjRobot.from_parameters({"stage2.wall.angle": -0.2, "stage2.wall.dissipation": 1.0})
    _, true, _ = drive(robot, np.full((1500, 2), [0.0, -0.8]))
    assert true[:, 1, 1].min() == pytest.approx(-0.2, abs=5e-3)


def test_the_drive_ends_at_its_stops():
    _, true, _ = drive(SfjRobot.from_parameters({}), np.full((3000, 2), [8.0, 1.5]))
    assert np.all(true[:, :, 0].max(axis=0) < 0.5 * math.pi + 0.05)
    unlimited = SfjRobot.from_parameters({"stage1.range": math.inf})
    assert drive(unlimited, np.full((3000, 2), [8.0, 0.0]))[1][-1, 0, 0] > 3.0


def test_a_model_file_is_found_beside_the_parameter_file(tmp_path):
    model = flexible(stiffness=5.0)
    (tmp_path / "models").mkdir()
    model.save(tmp_path / "models" / "other.yaml")
    robot = SfjRobot.from_parameters({"stage1.model": "models/other.yaml"}, folder=tmp_path)
    assert robot.joints[0].model.parameters["stiffness"] == 5.0


def test_bad_parameters_are_refused_with_key_and_remedy(tmp_path):
    with pytest.raises(
        ConfigurationError, match=r"x.yaml.*wall.stifness.*did you mean stage1.wall.stiffness"
    ):
        SfjRobot.from_parameters({"stage1.wall.stifness": 1.0}, source="x.yaml")
    with pytest.raises(ConfigurationError, match=r"stage1.model.*nowhere.yaml.*no such file"):
        SfjRobot.from_parameters({"stage1.model": "nowhere.yaml"}, folder=tmp_path)
    path = tmp_path / "stage1.yaml"
    flexible(("hard_stop", "arm", {"angle": 1.0, "stiffness": 100.0})).save(path)
    with pytest.raises(ModelError, match=r"stage1.yaml.*one of stage2 is needed"):
        SfjRobot.from_parameters({"stage2.model": str(path)})
    with pytest.raises(ModelError, match=r"hard_stop at stage1_arm already.*stage1.wall.angle"):
        SfjRobot.from_parameters({"stage1.model": str(path), "stage1.wall.angle": 0.5})
    with pytest.raises(ModelError, match="one of stage2 is needed"):
        SfjSettings(stage2=stage_hardware("stage1"))
    with pytest.raises(ConfigurationError, match=r"omni_y.hand.times do not increase"):
        OmniRobot.from_parameters({"omni_y.hand.times": [0.0, 0.0], "omni_y.hand.angles": [0.0, 0.1]})


@pytest.mark.parametrize("table", [SFJ_PARAMETERS, OMNI_PARAMETERS], ids=["sfj", "omni"])
def test_every_parameter_says_what_it_is(table):
    for parameter in table:
        assert parameter.meaning, parameter.name


# The Omni.


def test_the_omni_reports_counts_filtered_velocity_and_the_torque_applied_last():
    robot = OmniRobot()
    efforts = sines(600, 3)
    sensed, true, _ = drive(robot, efforts)
    counts = sensed[:, 0] / OMNI_RESOLUTION
    np.testing.assert_allclose(counts, np.rint(counts), atol=1e-6)
    assert np.all(np.abs(sensed[:, 0] - true[:, :, 0]) <= 0.5 * OMNI_RESOLUTION * (1 + 1e-9))
    np.testing.assert_allclose(sensed[1:, 2], np.clip(efforts[:-1], -0.446, 0.446), atol=1e-15)


def test_the_omni_clamps_its_torque_and_refuses_what_is_not_finite():
    robot = OmniRobot()
    assert robot.step([0.0, 1.0, -1.0]) == StepResult.LIMITED
    np.testing.assert_array_equal(robot.flow, [0.0, 0.446, -0.446])
    assert robot.step([math.nan, 0.0, 0.0]) == StepResult.REFUSED_COMMAND
    np.testing.assert_array_equal(robot.flow, [0.0, 0.0, 0.0])


def test_the_internal_spring_pulls_y_in_the_positive_direction_and_nothing_else_moves():
    robot = OmniRobot()
    _, true, _ = drive(robot, np.zeros((5000, 3)))
    assert np.all(true[:, [0, 2]] == 0.0)
    rest = math.radians(38.0)
    # Friction stops it somewhere about the rest of the spring.
    assert true[-1, 1, 0] == pytest.approx(rest, abs=0.03 / 0.1173 + 0.01)
    held = OmniRobot()
    torque = [0.0, -0.1173 * rest, 0.0]
    assert abs(drive(held, np.tile(torque, (3000, 1)))[1][-1, 1, 0]) < 1e-3


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_the_omni_stays_within_its_ranges(direction):
    _, true, _ = drive(OmniRobot(), np.full((4000, 3), direction * 0.4))
    upper = np.array([0.98, math.radians(50.0), math.radians(52.5)])
    reached = direction * true[:, :, 0]
    assert np.all(reached.max(axis=0) < upper + 0.1)
    assert np.all(reached[-1] > upper)


def test_the_omni_starts_where_it_is_put():
    robot = OmniRobot(OmniSettings(omni_z=axis_hardware("omni_z", initial_angle=0.3)))
    position, velocity, _ = robot.sense()
    assert position[2] == pytest.approx(0.3, abs=OMNI_RESOLUTION)
    assert np.abs(velocity).max() < 1e-9


@pytest.mark.parametrize(("where", "delay"), [("actuator", 0.013), ("motor_encoder", -0.011)])
def test_stamps_that_no_running_robot_has_are_refused_and_a_late_encoder_is_not(where, delay):
    """They were left out without a word, and `compare` simulated another machine than the plant."""

    def with_skew(place: str, delay: float) -> SfjSettings:
        skew = Effect("channel_skew", f"stage1_{place}", {"delay": delay})
        stage = stage_hardware("stage1")
        return SfjSettings(stage1=replace(stage, model=stage.model.with_effects(skew)))

    told = f"channel_skew at stage1_{where} is an error of a recording's stamps"
    with pytest.raises(ModelError, match=told):
        with_skew(where, delay)
    with_skew("motor_encoder", 0.011)
