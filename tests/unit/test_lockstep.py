"""Scenario 1 without ROS or clock: deterministic, timed as the graph, and recorded as the graph."""

import copy
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.laws import LAWS, ForceLaw
from haptic_teleop_control.recording import read_recording
from haptic_teleop_control.robots import SFJ_STAGES, STAGES
from haptic_teleop_sim.lockstep import at_limit, main, run_scenario
from haptic_teleop_sim.scenario_parameters import TABLES, check_scenario, load_scenario
from haptic_teleop_sim.scenario_run import AT_LIMIT, ScenarioResult, simulate_scenario

CONSTANTS = [SFJ_STAGES[stage].torque_constant for stage in STAGES]
QUIET = {"offset": 0.0, "noise": 0.0, "resolution": 0.0}


def sections(**changes):
    """A short scenario: free motion, then the wall at 0.3 rad. `changes`: node -> parameters."""
    found = {
        "sfj_sim": {"stage1.wall.angle": 0.3, "stage2.wall.angle": 0.3,
                    "stage1.wall.dissipation": 1.0, "stage2.wall.dissipation": 1.0},
        "omni_sim": {},
        "force_controller": {},
        "signal_generator": {
            "stage1.enabled": True, "stage1.step.enabled": True, "stage1.step.amplitude": 0.06,
            "stage2.enabled": True, "stage2.step.enabled": True, "stage2.step.amplitude": 0.08,
        },
    }  # fmt: skip
    for node, values in changes.items():
        found[node] = {**found[node], **values}
    return found


def assert_equal(a, b):
    assert a.keys() == b.keys()
    for topic, one in a.items():
        other = b[topic]
        np.testing.assert_array_equal(one.stamp, other.stamp)
        for field in ("position", "velocity", "effort"):
            left, right = getattr(one, field), getattr(other, field)
            assert (left is None) == (right is None)
            if left is not None:
                np.testing.assert_array_equal(left, right, err_msg=f"{topic} {field}")


def test_equal_seeds_give_equal_topics_bit_by_bit_and_other_seeds_do_not():
    runs = [run_scenario(sections(), 1.0, seed) for seed in (5, 5, 6)]
    assert_equal(runs[0], runs[1])
    assert not np.array_equal(runs[0]["/sfj/joint_states"].effort, runs[2]["/sfj/joint_states"].effort)


@pytest.mark.parametrize("source", ["reference", "device"])
def test_the_loop_in_python_and_the_compiled_one_give_the_same_bit_by_bit(source):
    felt = {"omni_y.feedback_gain": 0.1, "omni_y.feedback_cutoff_hz": 20.0}
    hand = {"omni_y.hand.times": [0.1, 0.5], "omni_y.hand.angles": [0.0, 0.1]}
    content = sections(
        force_controller={"command_source": source, **felt},
        omni_sim={"operator.mode": "trajectory", **hand},
        sfj_sim={"stage1.disturbance.rms": 0.05},
    )
    scenario = check_scenario(content)
    law = LAWS["augmented_error"].from_parameters(scenario.nodes["force_controller"], STAGES, 0.002)
    compiled, python = simulate_scenario(scenario, 1.5), simulate_scenario(scenario, 1.5, law=law)
    assert_equal(compiled.topics, python.topics)
    assert compiled.counts == python.counts
    assert np.ptp(compiled.topics["/omni/effort_command"].effort[:, 1]) > 0.01


def test_every_robot_has_its_rate_and_every_command_the_stamp_of_its_state():
    topics = run_scenario(sections(signal_generator={"rate": 250.0}), 0.5)
    counts = {topic: len(series) for topic, series in topics.items()}
    assert counts == {
        "/sfj/joint_states": 250, "/sfj/effort_command": 250, "/omni/joint_states": 500,
        "/omni/effort_command": 500, "/reference": 125,
    }  # fmt: skip
    for robot, period in (("sfj", 2_000_000), ("omni", 1_000_000)):
        states, commands = topics[f"/{robot}/joint_states"], topics[f"/{robot}/effort_command"]
        np.testing.assert_array_equal(states.stamp, commands.stamp)
        assert np.all(np.diff(states.stamp) == period)


def test_the_answer_to_a_state_acts_until_the_next_state():
    """What flows at a sample is what was commanded in answer to the one before, as in the graph."""
    silent = {f"{stage}.current_sense.{key}": value for stage in STAGES for key, value in QUIET.items()}
    silent |= {f"{stage}.amplifier.resolution": 0.0 for stage in STAGES}
    topics = run_scenario(sections(sfj_sim=silent), 1.0)
    measured = topics["/sfj/joint_states"].effort[:, [0, 2]]
    np.testing.assert_allclose(measured[1:], topics["/sfj/effort_command"].effort[:-1], atol=1e-12)
    applied, commanded = topics["/omni/joint_states"].effort, topics["/omni/effort_command"].effort
    np.testing.assert_allclose(applied[1:], commanded[:-1], atol=1e-15)


def test_the_commands_are_those_of_equations_25_to_32():
    """Written down a second time, without anti-windup: while the limit does not hold."""
    content = sections(force_controller={"ramp_time": 0.0}, sfj_sim={"stage1.wall.angle": 10.0})
    content["signal_generator"]["stage1.step.amplitude"] = 0.01
    content["signal_generator"]["stage2.step.amplitude"] = 0.01
    topics = run_scenario(content, 1.0)
    states, commands = topics["/sfj/joint_states"], topics["/sfj/effort_command"]
    for i, stage in enumerate(STAGES):
        ks, kt = SFJ_STAGES[stage].stiffness, CONSTANTS[i]
        motor, arm = states.position[:, 2 * i], states.position[:, 2 * i + 1]
        te = ks * (motor - arm)
        s = 10.0 * 0.01 - te - 0.5 * states.velocity[:, 2 * i]
        tc = te + 2.0 * s + 10.0 * np.cumsum(s) * 0.002
        wanted = 5.0 * (arm + tc / ks - motor) - 0.05 * states.velocity[:, 2 * i]
        np.testing.assert_allclose(commands.effort[:, i], wanted * kt, atol=1e-10)


def test_free_speed_and_contact_torque_are_those_that_the_thesis_asks_for():
    """Td / lambda while free, Td at the wall (4.4.1), within what friction and quantisation leave."""
    states = run_scenario(sections(sfj_sim={"stage1.wall.angle": 1.0, "stage2.wall.angle": 1.0}), 8.0)[
        "/sfj/joint_states"
    ]
    for i, desired in enumerate((0.6, 0.8)):
        arm, torque = states.position[:, 2 * i + 1], states.effort[:, 2 * i + 1]
        first = int(np.argmax(arm >= 1.0))
        assert first > 0
        approach = states.velocity[first - 50 : first, 2 * i].mean()
        assert approach == pytest.approx(desired / 0.5, rel=0.15)
        assert torque[-500:].mean() == pytest.approx(desired, rel=0.02)
        # The arm stays where the wall carries the torque.
        assert arm[-1] == pytest.approx(1.0 + desired / 2000.0, abs=1e-3)


def test_a_law_of_one_s_own_drives_the_slave():
    class Constant(LAWS["augmented_error"]):
        def step(self, desired_torque, motor_position, arm_position, motor_velocity):
            super().step(desired_torque, motor_position, arm_position, motor_velocity)
            return np.array([0.05, -0.1])

    law = Constant.from_parameters({}, STAGES, 0.002)
    assert isinstance(law, ForceLaw)
    commands = run_scenario(sections(force_controller={"ramp_time": 0.0}), 0.2, law=law)[
        "/sfj/effort_command"
    ]
    np.testing.assert_allclose(commands.effort, np.tile([0.05 * CONSTANTS[0], -0.1 * CONSTANTS[1]], (100, 1)))


def test_the_reference_is_that_of_the_signal_generator_and_zero_when_it_was_not_started():
    topics = run_scenario(
        sections(signal_generator={"stage1.delay": 0.1, "joints": ["omni_z", "omni_y"]}), 0.3
    )
    reference = topics["/reference"]
    assert reference.names == ("omni_z", "omni_y")
    assert reference.velocity is None and reference.effort is None
    t = reference.time()
    np.testing.assert_allclose(reference.position[:, 0], np.where(t >= 0.1, 0.06, 0.0))
    np.testing.assert_allclose(reference.position[:, 1], 0.08)
    waiting = run_scenario(sections(signal_generator={"autostart": False}), 0.3)
    assert np.all(waiting["/reference"].position == 0.0)


def test_the_stages_can_be_exchanged_by_the_joints_of_the_generator():
    straight = run_scenario(sections(), 0.4)
    values = sections()["signal_generator"]
    amplitudes = {"stage1.step.amplitude": 0.08, "stage2.step.amplitude": 0.06}
    crossed = {**values, "joints": ["omni_z", "omni_y"], **amplitudes}
    swapped = run_scenario({**sections(), "signal_generator": crossed}, 0.4)
    np.testing.assert_array_equal(
        straight["/sfj/joint_states"].position, swapped["/sfj/joint_states"].position
    )


def test_what_is_recorded_is_what_was_run(tmp_path, repository):
    scenario = repository / "config" / "scenario1_sim.yaml"
    bag = tmp_path / "bag"
    assert main([str(scenario), "--record", str(bag), "--duration", "0.5", "--seed", "4"]) == 0
    recording = read_recording(bag)
    assert recording.complete
    assert recording.problems == []
    assert_equal(recording.topics, run_scenario(scenario, 0.5, 4))
    assert recording.experiment["kind"] == "scenario1_sim"
    assert recording.experiment["runner"] == "lockstep"
    stated = recording.parameters
    assert stated["/sfj/sfj_sim"]["seed"] == 4
    assert stated["/force_controller"]["stage1.lambda"] == 0.5
    assert set(stated) == {"/sfj/sfj_sim", "/omni/omni_sim", "/force_controller", "/signal_generator"}


@pytest.mark.parametrize(
    ("file", "late"), [("scenario1_sim", 0.0), ("scenario2_sim", 0.0), ("scenario1_link_sim", 0.04)]
)
def test_the_states_of_the_teleoperation_are_recorded_as_the_node_publishes_them(
    tmp_path, repository, file, late
):
    bag = tmp_path / "bag"
    scenario = repository / "config" / f"{file}.yaml"
    assert main([str(scenario), "--record", str(bag), "--duration", "0.3"]) == 0
    with AnyReader([bag]) as reader:
        (topic,) = [one for one in reader.connections if one.topic == "/force_controller/state"]
        said = [(at, reader.deserialize(raw, one.msgtype).data) for one, at, raw in reader.messages([topic])]
        begun = reader.start_time
    assert topic.msgtype == "std_msgs/msg/String"
    assert [state for _, state in said] == ["off", "devices_ready", "aligning", "engaged"]
    assert said[0][0] == begun
    # Both robots are aligned from the start; over the link it takes until either has heard of the other.
    assert late - 0.02 <= (said[-1][0] - begun) * 1e-9 <= late + 0.02
    (offered,) = topic.ext.offered_qos_profiles
    assert offered.durability == QosDurability.TRANSIENT_LOCAL  # latched again by who plays it


def test_a_recording_holds_the_topics_that_the_recorder_is_told(tmp_path, repository, capsys):
    content = yaml.safe_load((repository / "config/scenario1_sim.yaml").read_text())
    topics = ["/reference", "sfj/joint_states", "/link/teleoperation/master", "/diagnostics"]
    content["recorder"]["ros__parameters"]["topics"] = topics
    file = tmp_path / "few.yaml"
    file.write_text(yaml.safe_dump(content))
    assert main([str(file), "--duration", "0.5", "--record", str(tmp_path / "few")]) == 0
    with AnyReader([tmp_path / "few"]) as reader:
        assert set(reader.topics) == {"/reference", "/sfj/joint_states"}
    assert "nodes alone publish it, or nobody: /link/teleoperation/master\n" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("key", "value", "hint"),
    [
        ("topics", ["/no/such"], "recorder.topics names nothing that there is: choose among /"),
        ("topisc", ["/reference"], "topisc"),
    ],
)
def test_topics_that_are_not_there_and_unknown_keys_of_the_recorder_are_refused(
    tmp_path, repository, capsys, key, value, hint
):
    content = yaml.safe_load((repository / "config/scenario1_sim.yaml").read_text())
    content["recorder"]["ros__parameters"] = {key: value}
    file = tmp_path / "wrong.yaml"
    file.write_text(yaml.safe_dump(content))
    assert main([str(file), "--duration", "0.5", "--record", str(tmp_path / "none")]) == 2
    assert hint in capsys.readouterr().err
    assert not (tmp_path / "none").exists()


def test_the_current_limit_is_told_by_stage_and_with_what_it_means(repository):
    scenario = check_scenario(sections(signal_generator={"stage1.step.amplitude": 0.06}))
    limit = scenario.nodes["force_controller"]["stage1.current_limit"]
    effort = np.zeros((1000, 2))
    effort[:5, 0] = -limit * CONSTANTS[0]
    commands = SimpleNamespace(effort=effort)
    result = ScenarioResult({"/sfj/effort_command": commands}, {AT_LIMIT: 5})
    (line,) = at_limit(scenario, result)
    assert line.startswith("stage1: ") and "5 of 1000 samples: so short" in line
    effort[:100, 1] = scenario.nodes["force_controller"]["stage2.current_limit"] * CONSTANTS[1]
    assert "100 of 1000 samples: ask for less torque" in at_limit(scenario, result)[1]
    assert at_limit(scenario, ScenarioResult(result.topics, {})) == []


def test_an_existing_recording_is_not_overwritten(tmp_path, repository, capsys):
    (tmp_path / "bag").mkdir()
    arguments = [str(repository / "config" / "scenario1_sim.yaml"), "--record", str(tmp_path / "bag")]
    assert main([*arguments, "--duration", "0.1"]) == 2
    assert "bag" in capsys.readouterr().err


def test_the_duration_is_the_file_s_unless_stated(repository):
    scenario = load_scenario(repository / "config" / "scenario1_sim.yaml")
    topics = run_scenario(scenario)
    assert len(topics["/sfj/joint_states"]) == round(scenario.duration * 500.0)


NODES = ["sfj_sim", "omni_sim", "force_controller", "signal_generator"]
BAD = {
    "a driver": ({"/**": {"device": "emulated"}, "sfj_driver": {"rate": 500.0}}, "describe it in sfj_sim"),
    "unknown node": ({"sfj_simm": {"rate": 500.0}}, "did you mean sfj_sim"),
    "unknown key": ({"sfj_sim": {"rat": 500.0}}, "did you mean rate"),
    "wrong type": ({"sfj_sim": {"seed": 1.5}}, "seed"),
    "not finite": ({"force_controller": {"stage1": {"kp": float("nan")}}}, "stage1.kp"),
    "rates that differ": ({"sfj_sim": {"rate": 1000.0}}, "slave_rate"),
    "two masters": ({"force_controller": {"slave": "omni"}}, "master and slave are both omni"),
    "rates of the other roles": ({"force_controller": {"master": "sfj", "slave": "omni"}}, "slave_rate"),
    "nobody to engage": ({"force_controller": {"auto_engage": False}}, "auto_engage"),
    "an effort as position": ({"signal_generator": {"kind": "effort"}}, "kind: position"),
    "unknown joints": ({"signal_generator": {"joints": ["omni_x", "omni_y"]}}, "omni_z"),
    "no such model": ({"sfj_sim": {"stage1": {"model": "none.yaml"}}}, "none.yaml"),
    "a bad duration": ({"scenario": {"nodes": ["sfj_sim"], "duration": -1.0}}, "duration"),
    "no nodes": ({"scenario": {"duration": 1.0}}, "node scenario: parameter nodes is missing"),
    "a misspelt node": (
        {"scenario": {"nodes": ["sfj_simm", "omni_sim"]}}, "nodes: sfj_simm is not a node; did you mean sfj_"
    ),
    "a node named twice": ({"scenario": {"nodes": [*NODES, "omni_sim"]}}, "nodes names one twice"),
    "one robot alone": (
        {"scenario": {"nodes": ["sfj_sim"]}}, "the list lacks omni_sim, force_controller, signal_generator"
    ),
    "a driver among the nodes": (
        {"scenario": {"nodes": ["sfj_driver", *NODES[1:]]}}, "lockstep runs no sfj_driver; without nodes"
    ),
    "a link that nobody runs": ({"force_controller": {"link": True}}, "the list lacks link;"),
    "a section of a node that is not named": ({"link": {"seed": 3}}, "link names no node of this config"),
    "a wildcard's key of nobody": ({"/**": {"sed": 3}}, "parameter sed is not a parameter"),
}  # fmt: skip


@pytest.mark.parametrize(("content", "hint"), BAD.values(), ids=BAD.keys())
def test_a_bad_scenario_ends_with_one_sentence_and_status_2(tmp_path, capsys, content, hint):
    path = tmp_path / "scenario.yaml"
    content = {"scenario": {"nodes": NODES}} | content
    nodes = {node: {"ros__parameters": values} for node, values in content.items()}
    path.write_text(yaml.safe_dump(nodes), encoding="utf-8")
    assert main([str(path), "--duration", "0.1"]) == 2
    error = capsys.readouterr().err.strip().splitlines()
    assert len(error) == 1
    assert str(path) in error[0]
    assert hint in error[0]


def test_where_a_hand_leads_no_signal_generator_is_needed(repository):
    assert load_scenario(repository / "docs" / "examples" / "scenario2_hand.yaml").duration == 8.0


@pytest.mark.parametrize("arguments", [["none.yaml"], [], ["x.yaml", "--duration", "long"]])
def test_bad_arguments_end_with_status_2(arguments, capsys):
    assert main(arguments) == 2
    assert capsys.readouterr().err


def test_a_duration_that_is_no_time_is_refused(repository, capsys):
    scenario = str(repository / "config" / "scenario1_sim.yaml")
    for bad in ("0", "-1", "nan", "inf"):
        assert main([scenario, "--duration", bad]) == 2
        assert "duration" in capsys.readouterr().err


def test_a_wildcard_speaks_to_those_that_know_the_key():
    scenario = check_scenario({"/**": {"seed": 9}, "sfj_sim": {}})
    assert scenario.nodes["sfj_sim"]["seed"] == 9
    assert scenario.nodes["omni_sim"]["seed"] == 9
    assert "seed" not in scenario.nodes["force_controller"]


def test_parameters_are_left_as_they_were():
    content = sections()
    before = copy.deepcopy(content)
    run_scenario(content, 0.05, 2)
    assert content == before


def test_the_tables_are_those_of_the_nodes():
    pytest.importorskip("rclpy")
    from haptic_teleop_control.nodes.force_controller import ForceController
    from haptic_teleop_control.nodes.signal_generator import SignalGeneratorNode
    from haptic_teleop_sim.nodes.omni_sim import OmniSim
    from haptic_teleop_sim.nodes.sfj_sim import SfjSim

    for node in (ForceController, SignalGeneratorNode, OmniSim, SfjSim):
        assert list(node.TABLE) == list(TABLES[node.NAME])


def test_a_scenario_of_a_mapping_with_an_unknown_node_is_refused():
    with pytest.raises(ConfigurationError, match="names no node"):
        run_scenario({"pump": {}}, 0.1)
