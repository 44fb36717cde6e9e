"""The drivers as nodes on emulated devices: as the plants, off at the end, captured and replayed."""

import math
import re
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from ros_graph import Graph, Sink, Source, stamp_of

from haptic_teleop_2dsfj.build import replay_capture as replay_sfj
from haptic_teleop_2dsfj.nodes.sfj_driver import SfjDriverNode
from haptic_teleop_2dsfj.replay_session import main as sfj_replay
from haptic_teleop_control.clocks import VirtualClock
from haptic_teleop_control.device_watch import DeviceWatch
from haptic_teleop_control.errors import RecordingError
from haptic_teleop_control.raw_capture import read_capture
from haptic_teleop_control.recording import read_recording
from haptic_teleop_control.robots import OMNI_JOINTS, SFJ_JOINTS, SFJ_MOTOR_JOINTS
from haptic_teleop_omni.build import replay_capture as replay_omni
from haptic_teleop_omni.nodes.omni_driver import OmniDriverNode

FRONT_DOOR = (sys.executable, "-m", "haptic_teleop_control.front_door")
# A machine that runs other tests at the same time may pause any program for longer than 20 ms.
PATIENT = {"device": "emulated", "timeout": 0.2}
SFJ = {**PATIENT, "board__watchdog": 0.2}
OMNI = {**PATIENT, "silence": 0.2, "calibration__method": "start", "emulated__docked_time": 0.0}
ROBOTS = {
    "sfj": (SfjDriverNode, SFJ, SFJ_JOINTS, SFJ_MOTOR_JOINTS, [2.0, 0.4], replay_sfj),
    "omni": (OmniDriverNode, OMNI, OMNI_JOINTS, OMNI_JOINTS, [0.0, 0.0, 0.1], replay_omni),
}


class Setting:
    """A driver on its emulated device, with a test that answers its states."""

    def __init__(self, graph: Graph, robot: str, **parameters: object) -> None:
        node, usual, joints, motors, self.push_with, _ = ROBOTS[robot]
        self.graph = graph
        self.states = Sink(graph, f"/{robot}/joint_states")
        self.command = Source(graph, f"/{robot}/effort_command", motors)
        self.node = graph.start(node, **{**usual, **parameters})
        graph.until(lambda: self.command.connected() and self.states.messages, what="discovery")

    @property
    def device(self):
        driver = self.node.driver
        return driver.board._hil if self.node.ROBOT == "sfj" else driver.transport

    def push(self, seconds: float = 0.15, effort=None) -> None:
        answered = len(self.states.messages)
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.graph.executor.spin_once(timeout_sec=0.01)
            if len(self.states.messages) > answered:
                answered = len(self.states.messages)
                self.send(effort)

    def send(self, effort=None) -> None:
        self.command.send(
            stamp=stamp_of(self.states.last), effort=self.push_with if effort is None else effort
        )

    def flows(self) -> bool:
        return bool(self.device.volts.any() if self.node.ROBOT == "sfj" else self.device.torque.any())


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_driver_publishes_what_the_simulated_plant_publishes(graph, robot):
    setting = Setting(graph, robot)
    graph.until(lambda: len(setting.states.messages) > 50)
    assert tuple(setting.states.last.name) == ROBOTS[robot][2]
    gaps = np.diff(setting.states.stamps)
    assert gaps.min() > 0
    period = 2e6 if robot == "sfj" else 1e6
    assert np.median(gaps) == pytest.approx(period, rel=0.3)
    assert not setting.flows()


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_command_moves_it_and_silence_stops_it(graph, robot):
    setting = Setting(graph, robot)
    setting.push(0.4)
    assert setting.flows()
    assert max(setting.states.last.position) > 0.01
    graph.until(lambda: setting.node.faults.latched)
    assert setting.node.faults.latched == "stale_command"
    graph.run(0.05)
    assert not setting.flows()
    assert graph.call(f"/{robot}/{robot}_driver/reset").success
    setting.push()
    assert setting.flows()


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_command_that_is_not_finite_stops_it(graph, robot):
    setting = Setting(graph, robot)
    setting.push()
    setting.send([math.nan, *setting.push_with[1:]])
    graph.until(lambda: setting.node.faults.latched)
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
    graph.until(lambda: setting.node.faults.latched == fault)
    graph.until(lambda: any(fault in s.message and s.level == b"\x02" for m in heard for s in m.status))
    values = {entry.key: entry.value for entry in heard[-1].status[0].values}
    assert values["device"] == "emulated"
    assert "states (Hz)" in values and f"fault {fault}" in values
    graph.run(0.3)
    states = len(setting.states.messages)
    graph.run(0.1)
    assert len(setting.states.messages) == states, "a lost device has no states"
    device.plug()
    assert graph.call(f"/{robot}/{robot}_driver/reset").success
    graph.until(lambda: len(setting.states.messages) > states + 20)
    assert setting.node.faults.latched is None


@pytest.mark.parametrize("robot", ROBOTS)
def test_at_the_end_nothing_flows_and_the_device_is_released(graph, robot):
    setting = Setting(graph, robot)
    setting.push()
    device = setting.device
    assert setting.flows()
    setting.node.shutdown_safely()
    if robot == "sfj":
        assert not device.volts.any()
        assert not any(device.amplifier_on)
        assert not device.opened
    else:
        assert not device.torque.any()
        assert not device.motors_on


class Held:
    """A device that blocks in one call of its driver until the test releases it, and a clock that the test
    moves."""

    def __init__(self, setting, call, monkeypatch):
        self.entered, self.released, self.clock = threading.Event(), threading.Event(), VirtualClock()
        setting.node.watch = DeviceWatch(self.clock, setting.node.values["device_timeout"])
        ordinary = getattr(setting.node.driver, call)

        def block(*arguments):
            if not self.released.is_set():
                self.entered.set()
                self.released.wait()
            return ordinary(*arguments)

        monkeypatch.setattr(setting.node.driver, call, block)
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
        states = len(setting.states.messages)
        graph.run(0.3)  # a long look at the machine's clock alone tells nothing
        assert setting.node.faults.counts["device_hangs"] == 0
        graph.until(lambda: (held.clock.advance(0.02), setting.node.faults.counts["device_hangs"])[1])
        assert len(setting.states.messages) <= states + 1
        held.clock.advance(0.2)
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
        held.clock.advance(0.2)
        # A reset does not bring it back.
        graph.until(lambda: setting.node.faults.latched == "device_hangs")
        assert setting.node.faults.counts["device_hangs"] == counted + 1
    finally:
        held.released.set()
    graph.until(lambda: len(setting.states.messages) > states + 20)
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
    graph.until(lambda: setting.node.failure is not None)
    assert isinstance(setting.node.failure, ZeroDivisionError)
    assert not device.volts.any()
    assert not any(device.amplifier_on)


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_captured_session_replays_to_the_same_states_byte_for_byte(graph, robot, tmp_path):
    file = tmp_path / "session.mcap"
    setting = Setting(graph, robot, capture=str(file))
    setting.push(0.3)
    graph.until(lambda: setting.node.faults.latched)  # falls silent: a fault and its reset are replayed too
    graph.call(f"/{robot}/{robot}_driver/reset")
    setting.push(0.2)
    setting.node.shutdown_safely()
    graph.run(0.1)
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
    setting.node.shutdown_safely()
    assert sfj_replay([str(file), "--output", str(tmp_path / "bag")]) == 0
    assert "joint states" in capsys.readouterr().out
    topic = read_recording(tmp_path / "bag").topic("/sfj/joint_states")
    assert topic.names == SFJ_JOINTS
    again = Sink(graph, "/again/joint_states")
    from rclpy.parameter import Parameter

    overrides = [Parameter("device", value="replay"), Parameter("replay.file", value=str(file))]
    node = SfjDriverNode(context=graph.context, namespace="again", parameter_overrides=overrides)
    graph._add(node)
    graph.until(again.connected)
    node.start()
    graph.until(lambda: not node._thread.is_alive())
    graph.run(0.1)
    replayed = {bytes(message.position) for message in again.messages}
    assert len(again.messages) > 0.9 * len(topic)
    assert replayed <= {row.tobytes() for row in topic.position}


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


def test_a_frozen_driver_finds_its_board_at_zero_when_it_wakes_and_stays_stopped(graph):
    states, heard = Sink(graph, "/sfj/joint_states"), []
    graph.probe.create_subscription(DiagnosticArray, "/diagnostics", heard.append, 10)

    def stopped() -> bool:
        status = heard[-1].status[0]
        expiries = next(int(entry.value) for entry in status.values if entry.key == "watchdog expiries")
        return status.level == b"\x02" and expiries > 0

    command = Source(graph, "/sfj/effort_command", SFJ_MOTOR_JOINTS)
    stated = ("device:=emulated", "timeout:=0.2", "board.watchdog:=0.1")
    process = subprocess.Popen(
        [*FRONT_DOOR, "sfj_driver", "--ros-args", *(part for rule in stated for part in ("-p", rule))]
    )
    try:
        graph.until(lambda: command.connected() and states.messages, what="discovery")

        def push(seconds: float) -> None:
            end = time.monotonic() + seconds
            while time.monotonic() < end:
                command.send(stamp=stamp_of(states.last), effort=[2.0, 0.4])
                graph.run(0.004)

        push(0.3)
        assert states.last.effort[0] > 1.0
        process.send_signal(signal.SIGSTOP)
        time.sleep(0.5)
        process.send_signal(signal.SIGCONT)
        count = len(states.messages)
        graph.until(lambda: len(states.messages) > count + 20)
        push(0.2)
        assert abs(states.last.effort[0]) < 0.5, "what is left is the offset and noise of the current's sense"
        graph.until(stopped)
        # Whichever it notices first: that its last command is old, or that the board went to 0 V.
        assert heard[-1].status[0].message.split(":")[0] in ("watchdog_expired", "stale_command")
    finally:
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 0


SCENARIO = """
/**:
  ros__parameters: {device: emulated, timeout: 0.2, realtime_priority: 20}
scenario:
  ros__parameters: {nodes: [sfj_driver, omni_driver, force_controller, signal_generator], duration: 2.0}
sfj_driver:
  ros__parameters: {board: {watchdog: 0.2}, emulated: {file: plant.yaml}}
omni_driver:
  ros__parameters: {rate: 500.0, silence: 0.2, emulated: {file: plant.yaml, docked_time: 0.3}}
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
    assert not recording.topic("/sfj/effort_command").effort[-1].any()
    assert len(recording.topic("/omni/joint_states")) > 500


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
    begins |= {"stage2.steps.levels"}
    for node in ("force_controller", "signal_generator"):
        different = {key for key in ours[node] | theirs[node] if ours[node].get(key) != theirs[node].get(key)}
        assert different <= begins
    for stage in ("stage1", "stage2"):
        law = f"{stage}.current_limit" if number == 1 else f"{stage}.master.current_limit"
        assert ours["sfj_driver"][f"{stage}.current_limit"] == ours["force_controller"][law] == 0.5
    assert ours["force_controller"]["auto_engage"] is False and not ours["signal_generator"]["autostart"]
