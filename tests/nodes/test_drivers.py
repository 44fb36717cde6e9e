"""The drivers as nodes on emulated devices: as the plants, off at the end, captured and replayed."""

import math
import re
import signal
import subprocess
import sys
import threading

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from ros_graph import Commanded, Graph, HeldTime, Sink, stamp_of

from haptic_teleop_2dsfj.build import replay_capture as replay_sfj
from haptic_teleop_2dsfj.nodes.sfj_driver import SfjDriverNode
from haptic_teleop_2dsfj.replay_session import main as sfj_replay
from haptic_teleop_control.errors import RecordingError
from haptic_teleop_control.raw_capture import read_capture
from haptic_teleop_control.recording import read_recording
from haptic_teleop_control.robots import OMNI_JOINTS, SFJ_JOINTS, SFJ_MOTOR_JOINTS
from haptic_teleop_omni.build import replay_capture as replay_omni
from haptic_teleop_omni.nodes.omni_driver import OmniDriverNode

FRONT_DOOR = (sys.executable, "-m", "haptic_teleop_control.front_door")
SFJ = {"device": "emulated"}
OMNI = {"device": "emulated", "calibration__method": "start", "emulated__docked_time": 0.0}
ROBOTS = {
    "sfj": (SfjDriverNode, SFJ, SFJ_JOINTS, SFJ_MOTOR_JOINTS, [2.0, 0.4], replay_sfj),
    "omni": (OmniDriverNode, OMNI, OMNI_JOINTS, OMNI_JOINTS, [0.0, 0.0, 0.1], replay_omni),
}


class Setting(Commanded):
    """A driver on its emulated device, with a test that answers its states."""

    def __init__(self, graph: Graph, robot: str, **parameters: object) -> None:
        node, usual, _, motors, self.push_with, _ = ROBOTS[robot]
        super().__init__(graph, node, motors, **{**usual, **parameters})

    @property
    def device(self):
        driver = self.node.driver
        return driver.board._hil if self.node.ROBOT == "sfj" else driver.transport

    def push(self, seconds: float = 0.15) -> None:
        self.answer(seconds, self.push_with)

    def flows(self) -> bool:
        return bool(self.device.volts.any() if self.node.ROBOT == "sfj" else self.device.torque.any())


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_driver_publishes_what_the_simulated_plant_publishes(graph, robot):
    setting = Setting(graph, robot)
    for _ in range(50):
        setting.state()
    assert tuple(setting.states.last.name) == ROBOTS[robot][2]
    period = 2_000_000 if robot == "sfj" else 1_000_000
    assert set(np.diff(setting.states.stamps)) == {period}
    assert not setting.flows()


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_command_moves_it_and_silence_stops_it(graph, robot):
    setting = Setting(graph, robot)
    setting.push(0.4)
    assert setting.flows()
    assert max(setting.states.last.position) > 0.01
    silent = graph.wall.now()
    graph.run_until(lambda: setting.node.faults.latched)
    assert setting.node.faults.latched == "stale_command"
    assert graph.wall.now() - silent <= round(setting.node.values["timeout"] * 1e9) + 2_000_000
    setting.state()
    assert not setting.flows()
    assert graph.call(f"/{robot}/{robot}_driver/reset").success
    setting.push()
    assert setting.flows()


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_command_that_is_not_finite_stops_it(graph, robot):
    setting = Setting(graph, robot)
    setting.push()
    setting.send(effort=[math.nan, *setting.push_with[1:]])
    assert setting.node.faults.latched == "non_finite_command"
    setting.push()
    assert not setting.flows()


@pytest.mark.parametrize(("robot", "fault"), [("sfj", "board_error"), ("omni", "device_lost")])
def test_an_unplugged_device_is_an_error_in_the_diagnostics_and_comes_back_with_a_reset(graph, robot, fault):
    heard: list = []
    graph.probe.create_subscription(DiagnosticArray, "/diagnostics", heard.append, 10)
    setting = Setting(graph, robot)
    setting.push()
    device = setting.device
    device.unplug()
    graph.wall.advance(0.002)
    graph.until(lambda: setting.node.faults.latched == fault)
    graph.until(lambda: any(fault in s.message and s.level == b"\x02" for m in heard for s in m.status))
    values = {entry.key: entry.value for entry in heard[-1].status[0].values}
    assert values["device"] == "emulated"
    assert "states (Hz)" in values and f"fault {fault}" in values
    states = setting.node.states.sent
    graph.wall.advance(0.1)
    graph.listen(0.2)
    assert setting.node.states.sent == states, "a lost device has no states"
    device.plug()
    assert graph.call(f"/{robot}/{robot}_driver/reset").success
    graph.run_until(lambda: setting.node.states.sent > states + 20)
    assert setting.node.faults.latched is None


@pytest.mark.parametrize("robot", ROBOTS)
def test_at_the_end_nothing_flows_and_the_device_is_released(graph, robot):
    setting = Setting(graph, robot)
    setting.push()
    device = setting.device
    assert setting.flows()
    graph.wall.release()
    setting.node.shutdown_safely()
    if robot == "sfj":
        assert not device.volts.any()
        assert not any(device.amplifier_on)
        assert not device.opened
    else:
        assert not device.torque.any()
        assert not device.motors_on


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_driver_that_stood_still_stops_its_robot_and_stays_so(graph, robot):
    """As the machine or SIGSTOP may hold it, for half a second, while its device goes on."""
    setting = Setting(graph, robot)
    setting.push()
    assert setting.flows()
    graph.until(lambda: graph.wall.settled)
    graph.wall.advance(0.5)
    setting.state()
    setting.state()
    assert setting.node.faults.latched is not None
    assert not setting.flows()
    setting.push()
    assert not setting.flows()


class Held:
    """A device that blocks in one call of its driver until the test releases it."""

    def __init__(self, setting, call, monkeypatch):
        self.entered, self.released = threading.Event(), threading.Event()
        ordinary = getattr(setting.node.driver, call)

        def block(*arguments):
            if not self.released.is_set():
                self.entered.set()
                self.released.wait()
            return ordinary(*arguments)

        monkeypatch.setattr(setting.node.driver, call, block)
        setting.graph.wall.advance(0.002)
        setting.graph.until(self.entered.is_set)


@pytest.mark.parametrize("call", ["read", "write"])
@pytest.mark.parametrize("robot", ROBOTS)
def test_a_device_that_holds_its_thread_is_an_error_and_stays_one_after_it_has_come_back(
    graph, robot, call, monkeypatch
):
    heard: list = []
    graph.probe.create_subscription(DiagnosticArray, "/diagnostics", heard.append, 10)
    setting = Setting(graph, robot)
    setting.push()
    held = Held(setting, call, monkeypatch)
    try:
        states = setting.node.states.sent
        graph.listen(0.3)  # a long look at the machine's clock alone tells nothing
        assert setting.node.faults.counts["device_hangs"] == 0
        graph.until(lambda: (graph.wall.advance(0.02), setting.node.faults.counts["device_hangs"])[1])
        assert setting.node.states.sent <= states + 1
        graph.wall.advance(0.2)
        setting.node._look()
        heard.clear()
        setting.node._report()
        status = graph.until(lambda: heard and heard[-1].status[0])
        values = {entry.key: entry.value for entry in status.values}
        assert status.level == b"\x02"
        assert re.search(rf"{call} has not come back for [0-9.]+ s", values["state"])
        assert float(re.search(r"([0-9.]+) s", values["state"])[1]) >= 0.6
        assert not {"amplifier", "motors"} & set(values), "what was so before the device held the driver"
        assert setting.node.permitted() is None
        counted = setting.node.faults.counts["device_hangs"]
        assert graph.call(f"/{robot}/{robot}_driver/reset").success
        graph.wall.advance(0.2)
        # A reset does not bring it back.
        graph.until(lambda: setting.node.faults.latched == "device_hangs")
        assert setting.node.faults.counts["device_hangs"] == counted + 1
    finally:
        held.released.set()
    graph.run_until(lambda: setting.node.states.sent > states + 20)
    graph.until(lambda: setting.node.state() == "fault")
    setting.push()
    assert setting.node.faults.latched == "device_hangs"
    assert not setting.flows()
    assert graph.call(f"/{robot}/{robot}_driver/reset").success
    setting.push(0.3)
    assert setting.node.faults.latched is None
    assert setting.flows()


def test_an_error_of_the_program_leaves_the_amplifier_off(graph, monkeypatch):
    setting = Setting(graph, "sfj")
    setting.push()
    device = setting.device

    def broken(*_: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(setting.node.driver.filter, "step", broken)
    graph.wall.advance(0.002)
    graph.until(lambda: setting.node.failure is not None)
    assert isinstance(setting.node.failure, ZeroDivisionError)
    assert not device.volts.any()
    assert not any(device.amplifier_on)


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_captured_session_replays_to_the_same_states_byte_for_byte(graph, robot, tmp_path):
    file = tmp_path / "session.mcap"
    setting = Setting(graph, robot, capture=str(file))
    setting.push(0.3)
    # Falls silent: a fault and its reset are replayed too.
    graph.run_until(lambda: setting.node.faults.latched)
    graph.call(f"/{robot}/{robot}_driver/reset")
    setting.push(0.2)
    graph.wall.release()
    setting.node.shutdown_safely()
    setting.hear()
    capture = read_capture(file, robot)
    assert capture.complete
    states = ROBOTS[robot][5](capture, capture.parameters)
    by_stamp = {stamp: row for row, stamp in enumerate(states.stamp.tolist())}
    assert len(setting.states.messages) > 200
    for message in setting.states.messages:
        row = by_stamp[stamp_of(message)]
        assert bytes(message.position) == states.position[row].tobytes()
        assert bytes(message.velocity) == states.velocity[row].tobytes()
        assert bytes(message.effort) == states.effort[row].tobytes()
    assert np.abs(states.effort).max() > 0.0


def test_the_replay_command_writes_a_recording_and_a_node_replays_it_as_well(graph, tmp_path, capsys):
    file = tmp_path / "session.mcap"
    setting = Setting(graph, "sfj", capture=str(file))
    setting.push(0.3)
    graph.wall.release()
    setting.node.shutdown_safely()
    assert sfj_replay([str(file), "--output", str(tmp_path / "bag")]) == 0
    assert "joint states" in capsys.readouterr().out
    topic = read_recording(tmp_path / "bag").topic("/sfj/joint_states")
    assert topic.names == SFJ_JOINTS
    again = Sink(graph, "/again/joint_states")
    from rclpy.parameter import Parameter

    overrides = [Parameter("device", value="replay"), Parameter("replay.file", value=str(file))]
    wall = HeldTime()
    node = SfjDriverNode(context=graph.context, namespace="again", wall=wall, parameter_overrides=overrides)
    graph._add(node)
    graph.until(again.connected)
    node.start()

    def ended() -> bool:
        if wall.settled and wall.next_waking is not None:
            graph.until(lambda: len(again.messages) == node.states.sent)
            wall.advance_to(wall.next_waking)
        return not node._thread.is_alive()

    graph.until(ended)
    graph.until(lambda: len(again.messages) == node.states.sent)
    assert [bytes(one.position) for one in again.messages] == [row.tobytes() for row in topic.position]


def test_a_capture_of_the_other_robot_or_of_nothing_is_refused(tmp_path):
    nothing = tmp_path / "nothing.mcap"
    nothing.write_bytes(b"no capture")
    for path in (nothing, tmp_path / "missing.mcap"):
        with pytest.raises(RecordingError, match=path.name):
            read_capture(path, "sfj")


def test_sigint_ends_a_driver_with_0_and_a_sentence_refuses_a_board_that_is_not_there():
    process = subprocess.Popen(
        [*FRONT_DOOR, "sfj_driver", "--ros-args", "-p", "device:=emulated"],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    line = process.stdout.readline()
    while "2DSFJ on" not in line:
        assert line, "ended before it ran"
        line = process.stdout.readline()
    process.send_signal(signal.SIGINT)
    assert process.wait(20) == 0
    done = subprocess.run(
        [*FRONT_DOOR, "sfj_driver"],
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert "quanser.hardware" in done.stderr.splitlines()[-1]


SCENARIO = """
/**:
  ros__parameters: {device: emulated, use_sim_time: true}
scenario:
  ros__parameters:
    nodes: [sfj_driver, omni_driver, force_controller, signal_generator]
    duration: 2.0
    real_time_factor: 0.0
sfj_driver:
  ros__parameters: {emulated: {file: plant.yaml}}
omni_driver:
  ros__parameters: {rate: 500.0, emulated: {file: plant.yaml, docked_time: 0.3}}
force_controller:
  ros__parameters: {master_rate: 500.0}
signal_generator:
  ros__parameters:
    rate: 200.0
    stage1: {enabled: true, step: {enabled: true, amplitude: 0.05}}
"""


def test_a_scenario_file_runs_the_drivers_by_one_parameter_and_moves_the_robot_behind_them(tmp_path):
    (tmp_path / "plant.yaml").write_text("sfj_sim:\n  ros__parameters: {stage1: {wall: {angle: 0.3}}}\n")
    file = tmp_path / "scenario.yaml"
    file.write_text(SCENARIO)
    done = subprocess.run(
        [*FRONT_DOOR, "scenario", str(file), "--record", str(tmp_path / "bag")],
        capture_output=True,
        text=True,
        timeout=90,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    recording = read_recording(tmp_path / "bag")
    arm = recording.topic("/sfj/joint_states").signal("stage1_arm", "position")
    assert 0.25 < arm.max() < 0.35, "it met the wall that the plant's file describes"
    assert recording.parameters["/sfj/sfj_driver"]["device"] == "emulated"
    assert len(arm) == 1000
    assert len(recording.topic("/omni/joint_states")) > 800, "all but those before its calibration"


@pytest.mark.parametrize("number", [1, 2])
def test_the_shipped_files_differ_from_the_simulated_ones_in_the_robots_and_in_who_begins(repository, number):
    from haptic_teleop_control.nodes.scenario import load_scenario
    from haptic_teleop_control.parameter_files import load_parameter_file

    real, sim = (repository / "config" / f"scenario{number}_{kind}.yaml" for kind in ("real", "sim"))
    assert load_scenario(real).nodes == ("sfj_driver", "omni_driver", "force_controller", "signal_generator")
    ours, theirs = load_parameter_file(real), load_parameter_file(sim)
    begins = {"auto_engage", "autostart", "stage1.delay", "stage2.delay"}
    # And in what the recommended current can do.
    begins |= {f"{stage}{side}.current_limit" for stage in ("stage1", "stage2") for side in ("", ".master")}
    # And a hand at a robot is kept from energy that nobody asked for.
    begins |= {"stage2.steps.levels", "passivity.controller"}
    for node in ("force_controller", "signal_generator"):
        different = {key for key in ours[node] | theirs[node] if ours[node].get(key) != theirs[node].get(key)}
        assert different <= begins
    for stage in ("stage1", "stage2"):
        law = f"{stage}.current_limit" if number == 1 else f"{stage}.master.current_limit"
        assert ours["sfj_driver"][f"{stage}.current_limit"] == ours["force_controller"][law] == 0.5
    assert ours["force_controller"]["passivity.controller"] is True
    assert ours["force_controller"]["auto_engage"] is False and not ours["signal_generator"]["autostart"]
