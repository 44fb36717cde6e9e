"""What a node says about itself: a fault at once, a warning for what is not yet one."""

import threading

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from ros_graph import Graph

from haptic_teleop_control.nodes.base.haptic_node import HapticNode
from haptic_teleop_control.nodes.force_controller import ForceController
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
        graph.run(0.1)
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
    plant = graph.start(SfjSim, timeout=0.2)
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
    graph.run(0.2)
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
