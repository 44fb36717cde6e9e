"""The controller as the operator meets it: states, services, roles, and the link, in a real ROS graph."""

import itertools
import subprocess
import sys

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_graph import Graph, Sink, Source
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

from haptic_teleop_control.nodes.force_controller import ForceController
from haptic_teleop_control.nodes.link import LinkEmulator
from haptic_teleop_control.nodes.operator_devices import told
from haptic_teleop_control.nodes.signal_generator import SignalGeneratorNode
from haptic_teleop_control.robots import OMNI_JOINTS, SFJ_JOINTS

SFJ_REST = {"position": [0.0] * 4, "velocity": [0.0] * 4, "effort": [0.0] * 4}
OMNI_REST = {"position": [0.0] * 3, "velocity": [0.0] * 3, "effort": [0.0] * 3}
LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
MANUAL = {"command_source": "device", "auto_engage": False, "ramp_time": 0.0}


class Setting:
    """A controller between two robots that the test plays."""

    def __init__(self, graph: Graph, **parameters: object) -> None:
        self.graph = graph
        self.controller = graph.start(ForceController, **{**MANUAL, **parameters})
        self.sfj = Source(graph, "/sfj/joint_states", SFJ_JOINTS)
        self.omni = Source(graph, "/omni/joint_states", OMNI_JOINTS)
        self.to_sfj, self.to_omni = Sink(graph, "/sfj/effort_command"), Sink(graph, "/omni/effort_command")
        self.states: list[str] = []
        graph.probe.create_subscription(
            String, "/force_controller/state", lambda message: self.states.append(message.data), LATCHED
        )
        ends = (self.sfj, self.omni, self.to_sfj, self.to_omni)
        graph.until(lambda: all(end.connected() for end in ends) and self.states, what="discovery")

    def sample(self, sfj=SFJ_REST, omni=OMNI_REST):
        """The efforts that answer one sample of each robot: of the 2DSFJ, of the Omni. 2 ms later."""
        self.pass_time()
        return self.answers(omni, sfj)

    def answers(self, omni, sfj):
        first, second = self.omni.send(**omni), self.sfj.send(**sfj)
        torque = self.graph.until(lambda: self.to_omni.answer_to(first), what="an answer to the Omni")
        effort = self.graph.until(lambda: self.to_sfj.answer_to(second), what="an answer to the 2DSFJ")
        return list(effort.effort), list(torque.effort)

    def pass_time(self) -> None:
        self.graph.wall.advance(0.002)

    def call(self, act: str, **samples: dict):
        """A service of the controller, with fresh samples of both robots before it."""
        client = self.graph.probe.create_client(Trigger, f"/force_controller/{act}")
        self.graph.until(client.service_is_ready)
        self.sample(**samples)
        return self.graph.call(f"/force_controller/{act}")

    @property
    def state(self) -> str:
        return self.controller._coupling.state.value


def at(angle: float) -> dict:
    return {**OMNI_REST, "position": [0.0, angle, 0.0]}


def test_nothing_is_driven_until_the_operator_engages(graph):
    setting = Setting(graph)
    for _ in range(3):
        assert setting.sample(omni=at(0.02)) == ([0.0, 0.0], [0.0, 0.0, 0.0])
    assert setting.state == "devices_ready"
    assert setting.call("engage").success
    assert setting.state == "engaged"
    effort, torque = setting.sample(omni=at(0.02))
    effort, torque = setting.sample(omni=at(0.02))
    assert effort[0] > 0.0 and torque[1] == pytest.approx(-0.3 * 0.02)
    graph.until(lambda: setting.states[-1] == "engaged")
    assert setting.states == ["off", "devices_ready", "aligning", "engaged"]


def test_out_of_alignment_the_master_is_pulled_back_and_the_offset_is_told(graph):
    setting = Setting(graph)
    setting.sample(omni=at(0.2))
    answer = setting.call("engage", omni=at(0.2))
    assert not answer.success
    assert "stage1" in answer.message and "+0.200 rad" in answer.message
    assert setting.state == "aligning"
    effort, torque = setting.sample(omni=at(0.2))
    assert effort == [0.0, 0.0]
    assert torque[1] == pytest.approx(-0.3 * 0.2)
    setting.sample(omni=at(0.01))
    assert setting.state == "aligning"  # the act was not kept
    assert setting.call("engage").success


def test_disengaging_fades_and_stays(graph):
    setting = Setting(graph, ramp_out_time=0.5)
    assert setting.call("engage").success
    setting.sample(omni=at(0.05))
    full = setting.sample(omni=at(0.05))[0][0]
    assert graph.call("/force_controller/disengage").success
    fading = [setting.sample(omni=at(0.05))[0][0]]
    for _ in range(250):
        fading.append(setting.sample(omni=at(0.05))[0][0])
    assert 0.0 < fading[240] < fading[120] < fading[0]
    assert 0.0 < fading[0] <= full
    assert all(later <= earlier for earlier, later in itertools.pairwise(fading))
    assert fading[-1] == 0.0
    assert setting.state == "devices_ready"
    assert not setting.call("disengage").success


def test_a_fault_is_left_by_reset_through_aligning_and_an_act(graph):
    setting = Setting(graph)
    assert setting.call("engage").success
    setting.sfj.send(**{**SFJ_REST, "effort": [float("nan"), 0.0, 0.0, 0.0]})
    graph.until(lambda: setting.state == "fault")
    assert setting.sample(omni=at(0.05)) == ([0.0, 0.0], [0.0, 0.0, 0.0])
    refused = setting.call("engage")
    assert not refused.success and "reset" in refused.message
    assert setting.call("reset").success
    effort, torque = setting.sample(omni=at(0.05))
    effort, torque = setting.sample(omni=at(0.05))
    assert setting.state == "aligning"
    assert effort == [0.0, 0.0] and torque[1] < 0.0
    assert setting.call("engage").success


def test_roles_are_swapped_when_nothing_is_driven_and_not_while_engaged(graph):
    setting = Setting(graph)
    assert setting.call("engage").success
    refused = setting.call("swap")
    assert not refused.success and "disengage" in refused.message
    assert setting.controller.values["master"] == "omni" and setting.state == "engaged"
    assert graph.call("/force_controller/disengage").success
    assert setting.call("swap").message == "master sfj, slave omni"
    assert setting.controller.values["slave_rate"] == 1000.0
    assert setting.call("engage").success
    # The hand pushes stage 1's arm 0.05 rad ahead: T_h = Ks 0.05, Td = 0.2 (T_h - 0.02), and the Omni, at
    # rest, gets Kp s + Ki s dt with s = Td, beside a spring that its observer takes for a torque.
    pushed = {
        "position": [0.0, 0.05, 0.0, 0.0],
        "velocity": [0.0] * 4,
        "effort": [0.0, -3.971 * 0.05, 0.0, 0.0],
    }
    setting.sample(sfj=pushed)
    torque = setting.sample(sfj=pushed)[1]
    law = setting.controller._coupling.slave_port.law
    td = 0.2 * (3.971 * 0.05 - 0.02)
    assert law.augmented_error[0] == pytest.approx(td - law.environment_torque[0], abs=1e-9)
    assert torque[1] > 0.0 and torque[0] == 0.0
    assert setting.call("disengage").success and setting.call("swap").success
    assert setting.controller.values["master"] == "omni"


def test_in_simulated_mode_roles_are_swapped_there_and_back_while_the_command_is_still_the_other_s(graph):
    setting = Setting(graph, command_source="reference")
    reference = Source(graph, "/reference", ["omni_y", "omni_z"])
    graph.until(reference.connected)
    message = setting.call("swap").message
    assert "master sfj" in message and "effort of stage1_arm and stage2_arm" in message
    received = setting.controller._coupling.streams.reference
    graph.until(lambda: reference.send(position=[0.0, 0.0]) and received.refused, what="the wrong command")
    refused = setting.call("engage")
    assert not refused.success and "omni_y" in refused.message
    assert "generator with `kind: effort`" in refused.message and "let a hand lead" in refused.message
    before = setting.controller._reference
    assert setting.call("swap").success and setting.controller.faults.latched is None
    for joints in (["omni_y", "omni_z"], ["stage1_arm", "stage2_arm"]):  # taken before, seen after
        before._receive(JointState(name=joints, position=[0.0, 0.0], effort=[0.0, 0.0]), {})
    assert setting.controller._coupling.streams.reference.at is None
    received = setting.controller._coupling.streams.reference
    graph.until(lambda: reference.send(position=[0.0, 0.0]) and received.at, what="the right command")
    assert setting.call("engage").success


def test_a_robot_that_reports_a_fault_of_its_own_is_not_coupled(graph):
    setting = Setting(graph)
    assert setting.call("engage").success
    said = graph.probe.create_publisher(DiagnosticArray, "/diagnostics", 10)
    graph.until(lambda: said.get_subscription_count() > 0)

    def say(level: bytes) -> None:
        said.publish(DiagnosticArray(status=[DiagnosticStatus(level=level, name="/omni/omni_driver")]))

    say(DiagnosticStatus.ERROR)
    graph.until(lambda: setting.state == "fault")
    assert setting.controller.faults.latched == "robot_fault"
    refusal = setting.call("engage").message
    assert "robot_fault" in refusal and "/omni/omni_driver" in refusal
    assert "haptic-teleop operate reset" in refusal
    assert setting.call("reset").success
    assert "/omni/omni_driver" in setting.call("engage").message
    say(DiagnosticStatus.OK)
    graph.until(lambda: not setting.controller._coupling.robot_faults)
    assert setting.call("engage").success


def test_one_role_alone_cannot_change(graph):
    setting = Setting(graph)
    result = setting.controller.set_parameters([Parameter("master", value="sfj")])[0]
    assert not result.successful and "both sfj" in result.reason
    assert setting.controller.values["master"] == "omni"


def test_a_side_that_goes_silent_is_noticed_by_the_other(graph):
    setting = Setting(graph)
    assert setting.call("engage").success
    graph.wall.advance(0.051)
    stamp = setting.sfj.send(**SFJ_REST)
    assert list(graph.until(lambda: setting.to_sfj.answer_to(stamp)).effort) == [0.0, 0.0]
    assert setting.controller.faults.latched == "stale_master"


class Linked(Setting):
    """With the node `link` between the two sides, whose packets travel by the held time."""

    def __init__(self, graph: Graph, delay: float, **parameters: object) -> None:
        self.link = graph.start(LinkEmulator, delay=delay)
        super().__init__(graph, link=True, **parameters)
        self.ways = self.controller._ways
        graph.until(lambda: all(way.input.publishers and way.out.subscribers for way in self.ways))

    def sample(self, **samples: dict):
        """What was sent is in the link."""
        efforts = super().sample(**samples)
        taken = self.link._in
        self.graph.until(lambda: all(i.count == w.out.sent for i, w in zip(taken, self.ways, strict=True)))
        return efforts

    def run(self, seconds: float, **samples: dict) -> None:
        for _ in range(round(seconds / 0.002)):
            self.sample(**samples)

    def pass_time(self) -> None:
        """What is due arrives before the next sample."""
        super().pass_time()
        now, taken = self.graph.wall.now(), sum(source.count for source in self.link._in)
        due = taken - sum(packet[0] > now for packet in list(self.link._under_way))
        self.graph.until(lambda: sum(way.input.count for way in self.ways) == due)


def test_what_goes_over_the_link_arrives_after_its_delay(graph):
    delay = 0.05
    setting = Linked(graph, delay, maximum_round_trip=1.0)
    setting.run(0.2)
    assert setting.state == "devices_ready"
    coupling = setting.controller._coupling
    assert coupling.round_trip == pytest.approx(2 * delay, abs=1e-6)  # each way once, to the moment
    assert setting.call("engage").success
    later = [setting.sample(omni=at(0.05))[0][0] for _ in range(30)]
    first = next(k for k, effort in enumerate(later) if effort)
    assert first == 25, "samples of 2 ms"
    assert coupling.heard[0, 0] == pytest.approx(10.0 * 0.05)


def test_a_link_that_takes_too_long_is_not_engaged(graph):
    setting = Linked(graph, 0.08, maximum_round_trip=0.12)
    setting.run(0.2)
    answer = setting.call("engage")
    assert not answer.success and "more than 120.0 ms" in answer.message
    assert setting.sample(omni=at(0.05))[0] == [0.0, 0.0]


def test_swapped_roles_bring_their_own_limit_of_the_round_trip(graph):
    setting = Linked(graph, 0.08)
    setting.run(0.2)
    assert "more than 100.0 ms" in setting.call("engage").message
    assert setting.call("disengage").success
    assert setting.call("swap").success
    setting.run(0.2)
    assert "more than 25.0 ms" in setting.call("engage").message


def test_a_link_that_goes_dead_is_a_fault(graph):
    setting = Linked(graph, 0.002)
    setting.run(0.02)
    assert setting.call("engage").success
    graph.end(setting.link)
    for _ in range(26):  # of 2 ms: both robots go on
        graph.wall.advance(0.002)
        setting.answers(OMNI_REST, SFJ_REST)
    assert setting.controller.faults.latched == "stale_link"


@pytest.mark.long
def test_the_command_operate_calls_the_services_and_prints_the_state(graph):
    setting = Setting(graph)
    setting.sample()

    def operate(act: str) -> tuple[int, str]:
        command = [sys.executable, "-m", "haptic_teleop_control.front_door", "operate", act]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

        def over() -> bool:
            setting.sample()
            return process.poll() is not None

        graph.until(over, 30.0, what=f"operate {act}")
        # What the middleware says of its shared memory is not ours; a slow machine is told what it waits for.
        ignored = ("RTPS_TRANSPORT_SHM", "waiting for /force_controller")
        errors = [e for e in process.stderr.readlines() if not any(i in e for i in ignored)]
        return process.returncode, process.stdout.read() + "".join(errors)

    assert operate("state") == (0, "devices_ready\n  devices_ready: aligned\n")
    assert operate("engage") == (0, "engaged\n")
    assert operate("state") == (0, "engaged\n")
    status, said = operate("swap")
    assert status == 1 and "disengage" in said
    setting.controller._coupling.fault(setting.controller.time.now(), "stale_slave", "0.1 s")
    status, said = operate("state")
    assert status == 0 and said.startswith("fault\n  stale_slave: ")


def test_engage_is_refused_while_a_pattern_runs_and_done_when_it_was_stopped(graph):
    setting = Setting(graph, command_source="reference")
    graph.start(SignalGeneratorNode, autostart=False, stage1__enabled=True)
    heard = lambda: setting.controller._coupling.streams.reference.at is not None  # noqa: E731
    graph.run_until(heard, what="a reference")
    assert graph.call("/signal_generator/start").success
    graph.until(lambda: setting.controller._coupling.pattern_runs, what="the news that a pattern runs")
    refused = setting.call("engage")
    assert not refused.success and "stop it first: haptic-teleop operate stop" in refused.message
    assert setting.state == "devices_ready"
    assert graph.call("/signal_generator/stop").success
    graph.until(lambda: not setting.controller._coupling.pattern_runs, what="the news that it was stopped")
    assert setting.call("engage").success
    assert graph.call("/signal_generator/start").success, "which is what `engage && start` does"


def test_operate_without_a_controller_ends_with_status_2():
    command = [sys.executable, "-m", "haptic_teleop_control.front_door", "operate", "engage", "--wait", "0.5"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert "start a scenario" in done.stderr and len(done.stderr.strip().splitlines()) == 1


@pytest.mark.no_graph
def test_operate_devices_tells_device_transport_and_serial_number_of_drivers_alone():
    def status(name: str, **values: str) -> DiagnosticStatus:
        pairs = [KeyValue(key=key, value=value) for key, value in values.items()]
        return DiagnosticStatus(name=name, message="driving", values=pairs)

    omni = {"device": "hardware", "transport": "openhaptics", "serial number": "EM0001"}
    omni |= {"torque output": "possible", "calibration": "done", "buttons": "0 0"}
    assert told(DiagnosticArray(status=[
        status("/omni/omni_driver", **omni),
        status("/sfj/sfj_driver", device="emulated"),
        status("/force_controller", state="engaged"),
    ])) == {
        "/omni/omni_driver": "/omni/omni_driver: device hardware, transport openhaptics, "
        "serial number EM0001, torque output possible, calibration done: driving",
        "/sfj/sfj_driver": "/sfj/sfj_driver: device emulated: driving",
    }  # fmt: skip
