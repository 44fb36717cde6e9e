"""What a node says about itself: a fault at once, a warning for what is not yet one."""

import threading

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from ros_graph import Graph, Source
from sensor_msgs.msg import JointState

from haptic_teleop_control.nodes.base import run
from haptic_teleop_control.nodes.base.haptic_node import HapticNode
from haptic_teleop_control.nodes.force_controller import ForceController
from haptic_teleop_control.nodes.launching.watch import Watcher
from haptic_teleop_control.nodes.link import LinkEmulator
from haptic_teleop_control.nodes.recorder import Recorder
from haptic_teleop_control.nodes.signal_generator import SignalGeneratorNode
from haptic_teleop_control.nodes.timing.time_base import LATEST_QOS
from haptic_teleop_control.robots import SFJ_MOTOR_JOINTS, STAGES
from haptic_teleop_sim.nodes.sfj_sim import SfjSim


class Heard:
    """The diagnostics of one node, without those that its timer sends."""

    def __init__(self, graph: Graph, node: HapticNode) -> None:
        self.graph, self.node = graph, node
        self.statuses: list[DiagnosticStatus] = []
        node._report_timer.cancel()
        name = node.get_fully_qualified_name()

        def take(message: DiagnosticArray) -> None:
            self.statuses += [status for status in message.status if status.name == name]

        graph.probe.create_subscription(DiagnosticArray, "/diagnostics", take, 10)
        graph.until(lambda: node._diagnostics.get_subscription_count() > 0, what="discovery")
        graph.listen()
        self.statuses.clear()

    @property
    def levels(self) -> list[bytes]:
        return [status.level for status in self.statuses]


def in_a_thread(work) -> None:
    """As a driver's device thread or a plant's thread would."""
    thread = threading.Thread(target=work)
    thread.start()
    thread.join()


def test_a_fault_of_a_robot_s_own_thread_reaches_the_controller_without_the_timer_and_its_reset_too(graph):
    plant = graph.start(SfjSim)
    controller = graph.start(ForceController, auto_engage=False)
    heard = Heard(graph, plant)
    in_a_thread(lambda: plant.fault("stale_command", "from its thread"))
    name = "/sfj/sfj_sim"
    graph.until(lambda: name in controller._coupling.robot_faults, what="the controller hears of the fault")
    assert "from its thread" in controller._coupling.robot_faults[name]
    assert graph.call("/sfj/sfj_sim/reset").success
    graph.until(lambda: not controller._coupling.robot_faults, what="the controller hears of the reset")
    assert heard.levels == [DiagnosticStatus.ERROR, DiagnosticStatus.OK]


def test_a_fault_that_repeats_is_announced_once(graph):
    plant = graph.start(SfjSim)
    heard = Heard(graph, plant)

    def repeat() -> None:
        for _ in range(200):
            plant.fault("stale_command", "again")

    in_a_thread(repeat)
    graph.until(lambda: heard.statuses)
    graph.listen(0.2)
    assert heard.levels == [DiagnosticStatus.ERROR]
    assert plant.faults.counts["stale_command"] == 200


def test_a_fault_that_is_reset_before_it_was_announced_is_announced_all_the_same(graph):
    plant = graph.start(SfjSim)
    heard = Heard(graph, plant)
    plant.fault("stale_command", "short")
    plant.faults.reset()
    graph.until(lambda: len(heard.statuses) >= 2)
    assert heard.levels == [DiagnosticStatus.ERROR, DiagnosticStatus.OK]


def test_the_loop_that_finds_a_fault_does_not_publish_itself(graph):
    plant = graph.start(SfjSim)
    heard = Heard(graph, plant)
    published: list[int] = []
    publish = plant._diagnostics.publish

    def spy(message: DiagnosticArray) -> None:
        published.append(threading.get_ident())
        publish(message)

    plant._diagnostics.publish = spy
    in_a_thread(lambda: plant.fault("stale_command", "from its thread"))
    assert not published
    graph.until(lambda: heard.statuses)
    assert published == [threading.get_ident()]


TURNS = 2
"""Of the executor, within which a latched fault is published: one that wakes it, one that publishes. How long
they last is printed by the benchmark `fault_latency`."""


def test_a_fault_is_published_within_two_turns_of_the_executor_whatever_else_is_due(graph):
    plant = graph.start(SfjSim)
    heard = Heard(graph, plant)
    order: list[str] = []
    publish = plant._diagnostics.publish
    plant._diagnostics.publish = lambda message: (order.append("fault"), publish(message))
    commands = Source(graph, plant.commands.topic, SFJ_MOTOR_JOINTS)
    graph.until(commands.connected)
    before = graph.wall.now()
    in_a_thread(lambda: plant.fault("stale_command", "from its thread"))
    for _ in range(50):  # what comes after the fault does not push it back
        commands.send(effort=[0.0, 0.0])
    for _ in range(TURNS):
        graph.executor.spin_once(timeout_sec=0.0)
    assert order == ["fault"]
    assert graph.wall.now() == before, "no timer was waited for"
    graph.until(lambda: heard.levels == [DiagnosticStatus.ERROR])


def test_the_single_threaded_executor_announces_too(graph):
    """Where rclpy has no other."""
    node = SfjSim(context=graph.context)
    listener = Node("listener", context=graph.context)
    executor = SingleThreadedExecutor(context=graph.context)
    try:
        executor.add_node(node)
        executor.add_node(listener)
        node._report_timer.cancel()
        heard: list[bytes] = []
        listener.create_subscription(
            DiagnosticArray, "/diagnostics", lambda m: heard.append(m.status[0].level), 10
        )
        graph.until(lambda: node._diagnostics.get_subscription_count() > 0)
        in_a_thread(lambda: node.fault("stale_command", "from its thread"))
        graph.until(lambda: executor.spin_once(timeout_sec=0.01) or DiagnosticStatus.ERROR in heard)
    finally:
        executor.shutdown()
        node.destroy_node()
        listener.destroy_node()


def report(heard: Heard) -> DiagnosticStatus:
    """What the node's timer would send now."""
    heard.statuses.clear()
    heard.node._report()
    heard.graph.until(lambda: heard.statuses, what="a report")
    return heard.statuses[-1]


@pytest.fixture
def quiet(graph) -> Heard:
    """A signal generator that does not run, so that nothing but the test changes what it counts."""
    node = graph.make(SignalGeneratorNode)
    heard = Heard(graph, node)
    report(heard)
    return heard


def test_a_node_without_trouble_reports_ok_and_its_state(quiet):
    status = report(quiet)
    assert (status.level, status.message) == (DiagnosticStatus.OK, "stopped")


def test_more_than_one_percent_of_periods_skipped_since_the_last_report_is_a_warning(quiet):
    thread = quiet.node._thread
    thread.cycles += 990
    thread.overruns += 10
    assert report(quiet).level == DiagnosticStatus.OK
    thread.cycles += 989
    thread.overruns += 11
    status = report(quiet)
    assert status.level == DiagnosticStatus.WARN
    assert status.message.startswith("11 of 1000 periods were skipped")
    assert report(quiet).level == DiagnosticStatus.OK


def test_a_fault_that_was_reset_between_two_reports_is_a_warning_and_a_latched_one_an_error(graph):
    heard = Heard(graph, graph.start(ForceController, auto_engage=False))
    report(heard)
    heard.node.fault("time_jump", "once")
    heard.node.faults.reset()
    status = report(heard)
    assert status.level == DiagnosticStatus.WARN
    assert "1 x time_jump, reset since" in status.message
    heard.node.fault("time_jump", "again")
    assert report(heard).level == DiagnosticStatus.ERROR
    heard.node.faults.reset()
    assert report(heard).level == DiagnosticStatus.OK


def test_a_real_time_priority_that_is_refused_is_a_warning(graph, quiet, monkeypatch):
    monkeypatch.setattr(run, "request_realtime", lambda priority: False)
    node = SignalGeneratorNode(context=graph.context)
    monkeypatch.setattr(run, "make_executor", lambda: SingleThreadedExecutor(context=graph.context))
    run.spin([node], lambda: True, realtime_priority=20, may_start=lambda: False)
    assert "real-time priority is refused" in "".join(node.warnings.take())
    node.destroy_node()


def test_a_topic_with_two_publishers_is_a_warning_even_while_only_one_sends(graph):
    heard = Heard(graph, graph.start(ForceController, auto_engage=False))
    topic = "/omni/joint_states"
    publishers = [graph.probe.create_publisher(JointState, topic, LATEST_QOS) for _ in range(2)]
    graph.until(lambda: heard.node._robots["omni"].input.publishers == 2)
    status = report(heard)
    assert status.level == DiagnosticStatus.WARN
    assert "/omni/joint_states has several publishers: /probe (2 times)" in status.message
    graph.probe.destroy_publisher(publishers[0])
    graph.until(lambda: heard.node._robots["omni"].input.publishers == 1)
    assert report(heard).level == DiagnosticStatus.OK


def test_packets_that_the_link_cannot_deliver_are_a_warning(graph):
    heard = Heard(graph, graph.start(LinkEmulator))
    source = Source(graph, "/teleoperation/master", STAGES)
    graph.until(source.connected)
    graph.until(lambda: source.send(velocity=[0.0], effort=[0.0, 0.0]) and heard.node.refused)
    status = report(heard)
    assert status.level == DiagnosticStatus.WARN and "not delivered" in status.message


def test_a_recorder_that_loses_messages_or_runs_out_of_disk_says_so_ahead(graph, tmp_path, monkeypatch):
    from haptic_teleop_control.nodes import recorder

    given = [Parameter("output", value=str(tmp_path / "bag")), Parameter("minimum_free_space", value=10**9)]
    node = Recorder(context=graph.context, parameter_overrides=given)
    graph.executor.add_node(node)
    try:
        heard = Heard(graph, node)
        free = [100e9]
        monkeypatch.setattr(
            recorder.shutil, "disk_usage", lambda path: type("Usage", (), {"free": free[0]})
        )
        node._follow()
        assert report(heard).level == DiagnosticStatus.OK
        node._topics[0].missed += 3
        assert report(heard).message == "3 messages were lost on the way here"
        free[0] = 1.1e9
        node._follow()
        status = report(heard)
        assert status.level == DiagnosticStatus.WARN and "the disk lasts for" in status.message
        assert not node.stop
    finally:
        graph.executor.remove_node(node)
        node.shutdown_safely()
        node.destroy_node()


def test_a_warning_is_no_fault_to_the_watcher_nor_to_the_controller(graph):
    watcher, controller = Watcher("omni"), graph.start(ForceController, auto_engage=False)
    for level in (DiagnosticStatus.WARN, DiagnosticStatus.WARN):
        message = DiagnosticArray(
            status=[DiagnosticStatus(level=level, name="/omni/omni_sim", message="7 of 9 were late")]
        )
        watcher._diagnose(message, {})
        controller._on_diagnostics(message, {})
    assert watcher.faults == {} and controller._coupling.robot_faults == {}
    assert watcher.warnings == {"/omni/omni_sim": (2, "7 of 9 were late")}


def test_a_warning_after_a_fault_says_that_the_fault_is_over(graph):
    watcher, controller = Watcher("sfj"), graph.start(ForceController, auto_engage=False)
    for level in (DiagnosticStatus.ERROR, DiagnosticStatus.WARN):
        status = DiagnosticStatus(level=level, name="/sfj/sfj_sim", message="words")
        watcher._diagnose(DiagnosticArray(status=[status]), {})
        controller._on_diagnostics(DiagnosticArray(status=[status]), {})
    assert watcher._in_fault == {} and controller._coupling.robot_faults == {}
    assert watcher.faults == {"/sfj/sfj_sim": "words"}


def test_the_fault_of_a_stray_node_with_a_robots_name_is_not_the_robots(graph):
    """It is told from the robot's by the process that the states come from."""
    controller = graph.start(ForceController, auto_engage=False)
    robot, stray = (bytes([number]) * 16 for number in (1, 2))
    fault = DiagnosticStatus(level=DiagnosticStatus.ERROR, name="/sfj/sfj_sim", message="words")
    controller._robots["sfj"].input._sender.admit(robot, 0)
    controller._on_diagnostics(DiagnosticArray(status=[fault]), {"publisher_gid": {"data": stray}})
    assert controller._coupling.robot_faults == {}
    controller._on_diagnostics(DiagnosticArray(status=[fault]), {"publisher_gid": {"data": robot}})
    assert controller._coupling.robot_faults == {"/sfj/sfj_sim": "words"}
    watcher = Watcher("sfj", simulated=True)
    watcher.processes = frozenset({robot[:12].hex()})
    watcher._diagnose(DiagnosticArray(status=[fault]), {"publisher_gid": {"data": stray}})
    assert watcher.faults == {}
    watcher._diagnose(DiagnosticArray(status=[fault]), {"publisher_gid": {"data": robot}})
    assert watcher.faults == {"/sfj/sfj_sim": "words"}
