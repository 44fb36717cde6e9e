"""A second sender on a stream: refused and named, wherever something listens; a successor is taken."""

from collections.abc import Callable

import pytest
from rclpy.node import Node
from ros_graph import Commanded, Graph, Sink, Source
from sensor_msgs.msg import JointState

from haptic_teleop_2dsfj.nodes.sfj_driver import SfjDriverNode
from haptic_teleop_control.nodes.acquisition import AcquisitionNode
from haptic_teleop_control.nodes.base import run
from haptic_teleop_control.nodes.base.haptic_node import HapticNode
from haptic_teleop_control.nodes.force_controller import ForceController
from haptic_teleop_control.nodes.link import LinkEmulator
from haptic_teleop_control.nodes.recording.recorded_topic import RecordedTopic
from haptic_teleop_control.nodes.signal_generator import SignalGeneratorNode
from haptic_teleop_control.nodes.streams.joint_states import JointStateReceiver
from haptic_teleop_control.nodes.timing.time_base import LATEST_QOS
from haptic_teleop_control.robots import OMNI_JOINTS, SFJ_JOINTS, SFJ_MOTOR_JOINTS, STAGES
from haptic_teleop_omni.nodes.omni_driver import OmniDriverNode
from haptic_teleop_sim.nodes.omni_sim import OmniSim
from haptic_teleop_sim.nodes.sfj_sim import SfjSim

SFJ_REST = {"position": [0.0] * 4, "velocity": [0.0] * 4, "effort": [0.0] * 4}
OMNI_REST = {"position": [0.0] * 3, "velocity": [0.0] * 3, "effort": [0.0] * 3}
PUSH = {"sfj": [0.1, 0.02], "omni": [0.0, 0.0, 0.01]}
MOTORS = {"sfj": SFJ_MOTOR_JOINTS, "omni": OMNI_JOINTS}
PACKET = {"velocity": [0.0] * 2, "effort": [0.0] * 2}
GOOD = {
    "/sfj/joint_states": (SFJ_JOINTS, SFJ_REST),
    "/omni/joint_states": (OMNI_JOINTS, OMNI_REST),
    "/reference": (["omni_y", "omni_z"], {"position": [0.0, 0.0]}),
    "/teleoperation/master": (STAGES, PACKET),
    "/teleoperation/slave": (STAGES, PACKET),
    "/link/teleoperation/master": (STAGES, PACKET),
    "/link/teleoperation/slave": (STAGES, PACKET),
}
"""Topic -> joints and fields of a good sample."""

EXPERIMENT = {
    "joint": "stage2",
    "signal.enabled": True,
    "signal.delay": 0.0,
    "signal.duration": 60.0,
    "signal.step.enabled": True,
    "signal.step.amplitude": 0.05,
}

BOTH = ("/probe", "/intruder")


class Intruder(Source):
    """A publisher of another node."""

    def __init__(self, graph: Graph, topic: str, names, name: str = "intruder") -> None:
        super().__init__(graph, topic, names)
        graph.probe.destroy_publisher(self.publisher)
        self.node = graph._add(Node(name, context=graph.context))
        self.publisher = self.node.create_publisher(
            JointState, topic, LATEST_QOS
        )
        graph.until(self.connected, what="discovery of the intruder")

    def leave(self) -> None:
        self.graph.nodes.remove(self.node)
        self.graph.executor.remove_node(self.node)
        self.node.destroy_node()


class Driven(Commanded):
    """A plant or driver whose states the test and others answer."""

    def __init__(self, graph: Graph, node: type[HapticNode], robot: str, **parameters: object) -> None:
        super().__init__(graph, node, MOTORS[robot], **parameters)
        self.push = PUSH[robot]

    def answered_by(self, *senders: Source) -> None:
        """Every sender answers the next state, in this order."""
        self.state()
        for sender in senders:
            self.send_by(sender, effort=self.push)

    def until_in_force(self, sender: Source, what: str = "a command in force") -> None:
        self.graph.until(lambda: self.answered_by(sender) or self.in_force(), what=what)

    def in_force(self) -> bool:
        return self.node.permitted() is not None


COMMANDED = {
    "sfj_sim": (SfjSim, "sfj", {}),
    "omni_sim": (OmniSim, "omni", {"rate": 500.0}),
    "sfj_driver": (SfjDriverNode, "sfj", {"device": "emulated"}),
    "omni_driver": (
        OmniDriverNode,
        "omni",
        {
            "device": "emulated",
            "calibration__method": "start",
            "emulated__docked_time": 0.0,
        },
    ),
}


@pytest.mark.parametrize("name", COMMANDED)
def test_a_late_second_sender_of_commands_latches_a_fault_with_both_names_and_never_drives(graph, name):
    node, robot, parameters = COMMANDED[name]
    setting = Driven(graph, node, robot, **parameters)
    setting.until_in_force(setting.command)
    intruder = Intruder(graph, f"/{robot}/effort_command", MOTORS[robot])
    taken: list[list[float]] = []
    store = setting.node.commands._on_sample

    def spy() -> None:
        taken.append(setting.node.commands.value["effort"].tolist())
        store()

    setting.node.commands._on_sample = spy
    wrong = [0.05] * len(MOTORS[robot])

    def both() -> object:
        setting.answered_by(setting.command)
        setting.send_by(intruder, effort=wrong)
        return setting.node.faults.latched

    graph.until(both, what="the fault")
    faults = setting.node.faults
    assert faults.latched == "second_sender"
    assert f"/{robot}/effort_command" in faults.detail and all(name in faults.detail for name in BOTH)
    assert not setting.in_force()
    assert wrong not in taken
    # The reset does not help while both go on; it does when one has left.
    assert graph.call(f"{setting.node.get_fully_qualified_name()}/reset").success
    graph.until(both, what="the fault again")
    assert setting.node.faults.latched == "second_sender"
    intruder.leave()
    assert graph.call(f"{setting.node.get_fully_qualified_name()}/reset").success
    setting.until_in_force(setting.command)
    assert wrong not in taken


def test_a_publisher_that_is_made_anew_at_once_is_taken_without_a_fault(graph):
    setting = Driven(graph, SfjSim, "sfj")
    setting.node.commands._sender._silence = 10**18  # ns: the graph alone says that the first is gone
    setting.until_in_force(setting.command)
    successor = Source(graph, "/sfj/effort_command", SFJ_MOTOR_JOINTS)
    graph.until(successor.connected)
    setting.answered_by(setting.command)
    graph.probe.destroy_publisher(setting.command.publisher)
    count = setting.node.commands.count
    graph.until(lambda: setting.answered_by(successor) or setting.node.commands.count > count + 3)
    assert setting.node.faults.latched is None
    assert setting.in_force()


class Controlled:
    """A controller between two robots that the test plays."""

    def __init__(self, graph: Graph, **parameters: object) -> None:
        self.graph = graph
        usual = {"command_source": "device", "auto_engage": True, "ramp_time": 0.0}
        self.node = graph.start(ForceController, **{**usual, **parameters})
        self.sfj = Source(graph, "/sfj/joint_states", SFJ_JOINTS)
        self.omni = Source(graph, "/omni/joint_states", OMNI_JOINTS)
        self.to_sfj = Sink(graph, "/sfj/effort_command")
        graph.until(lambda: self.sfj.connected() and self.omni.connected() and self.to_sfj.connected())

    def sample(self, *more: Callable[[], object]) -> list[float]:
        self.graph.wall.advance(0.002)
        self.omni.send(**OMNI_REST)
        for send in more:
            send()
        stamp = self.sfj.send(**SFJ_REST)
        return list(self.graph.until(lambda: self.to_sfj.answer_to(stamp), what="an answer").effort)

    @property
    def state(self) -> str:
        return self.node._coupling.state.value


@pytest.mark.parametrize("robot", ["omni", "sfj"])
def test_a_late_second_sender_of_states_ends_the_coupling_and_is_never_used(graph, robot):
    setting = Controlled(graph)
    graph.until(lambda: setting.sample() and setting.state == "engaged")
    joints, rest = (OMNI_JOINTS, OMNI_REST) if robot == "omni" else (SFJ_JOINTS, SFJ_REST)
    intruder = Intruder(graph, f"/{robot}/joint_states", joints)
    moved = {**rest, "position": [0.05] * len(joints)}

    def both() -> bool:
        effort = setting.sample(lambda: intruder.send(**moved))
        assert effort == [0.0, 0.0], "the intruder's angles must not drive"
        return setting.state == "fault"

    graph.until(both, what="the fault")
    faults = setting.node.faults
    assert faults.latched == "second_sender"
    assert f"/{robot}/joint_states" in faults.detail and all(name in faults.detail for name in BOTH)
    count = len(setting.to_sfj.messages)
    setting.sample()
    assert len(setting.to_sfj.messages) == count + 1, "one answer to each state"


def test_a_second_signal_generator_is_a_fault_where_the_reference_commands_and_none_where_it_does_not(graph):
    for source, expected in (("device", None), ("reference", "second_sender")):
        setting = Controlled(graph, command_source=source)
        reference = Source(graph, "/reference", ["omni_y", "omni_z"])
        intruder = Intruder(graph, "/reference", ["omni_y", "omni_z"])
        graph.until(reference.connected)
        received = setting.node._reference

        def both(ends=(reference, intruder), received=received) -> bool:
            for end in ends:
                end.send(position=[0.0, 0.0])
            graph.run(0.002)
            graph.listen(0.005)
            return received.refused > 5

        graph.until(both)
        assert setting.node.faults.latched == expected
        intruder.leave()
        graph.probe.destroy_publisher(reference.publisher)
        graph.end(setting.node)


def test_the_link_delivers_nothing_while_two_send_into_it(graph):
    link = graph.start(LinkEmulator, delay=0.0)
    out = Sink(graph, "/link/teleoperation/master")
    source = Source(graph, "/teleoperation/master", STAGES)
    graph.until(lambda: source.connected() and out.connected())
    graph.until(lambda: source.send(**PACKET) and out.messages, what="a packet")
    intruder = Intruder(graph, "/teleoperation/master", STAGES)

    def both() -> object:
        intruder.send(**PACKET)
        source.send(**PACKET)
        graph.run(0.002)
        graph.listen(0.005)
        return link.faults.latched

    graph.until(both)
    assert link.faults.latched == "second_sender"
    assert all(name in link.faults.detail for name in BOTH)
    graph.listen()
    delivered = len(out.messages)
    both()
    graph.listen()
    assert len(out.messages) == delivered
    intruder.leave()
    assert graph.call("/link/reset").success
    graph.until(lambda: source.send(**PACKET) and len(out.messages) > delivered)


def test_an_experiment_whose_robot_has_two_senders_of_states_goes_to_zero(graph):
    node = graph.start(AcquisitionNode, **EXPERIMENT)
    states, effort = Source(graph, "/sfj/joint_states", SFJ_JOINTS), Sink(graph, "/sfj/effort_command")
    graph.until(lambda: states.connected() and effort.connected())

    def answer() -> list[float]:
        stamp = states.send(**SFJ_REST)
        return list(graph.until(lambda: effort.answer_to(stamp)).effort)

    graph.until(lambda: any(answer()))
    intruder = Intruder(graph, "/sfj/joint_states", SFJ_JOINTS)
    graph.until(lambda: intruder.send(**SFJ_REST) and answer() and node.faults.latched)
    assert node.faults.latched == "second_sender"
    assert answer() == [0.0, 0.0]


@pytest.mark.parametrize(
    ("node", "parameters"),
    [(ForceController, {}), (ForceController, {"link": True}), (AcquisitionNode, EXPERIMENT),
     (SignalGeneratorNode, {}), (LinkEmulator, {})],
)  # fmt: skip
def test_a_node_that_was_not_started_answers_nobody_not_even_when_it_ends(graph, node, parameters):
    """While a scenario waits for its start, another one may run in its domain."""
    waiting = graph.make(node, **parameters)
    own = [end.topic_name for end in waiting.publishers if end.msg_type is JointState]
    sinks = [Sink(graph, topic) for topic in own]
    heard = [end.topic_name for end in waiting.subscriptions if end.msg_type is JointState]
    sources = {topic: Source(graph, topic, GOOD[topic][0]) for topic in heard}
    graph.until(lambda: all(end.connected() for end in (*sinks, *sources.values())), what="discovery")
    for _ in range(5):
        for topic, source in sources.items():
            source.send(**GOOD[topic][1])
        graph.listen(0.01)
    waiting.shutdown_safely()
    graph.listen()
    assert own
    assert not any(sink.messages for sink in sinks)


def test_an_rclpy_that_does_not_tell_senders_takes_all_samples_and_says_so_once(graph, monkeypatch):
    """As 7.1 of Jazzy: its info lacks the sender."""
    taken: list[int] = []
    receiver = JointStateReceiver(
        graph.probe, "/a", ["j"], ["position"], lambda: taken.append(receiver.stamp), silence=10.0
    )
    message = JointState(name=["j"], position=[0.0])
    for _ in range(3):
        receiver._receive(message, {"publication_sequence_number": 1})
    assert len(taken) == 3
    assert receiver.refused == 0

    monkeypatch.setattr(run, "SENDERS_TOLD", False)
    said: list[str] = []
    node = SfjSim(context=graph.context)
    monkeypatch.setattr(run, "make_executor", lambda: graph.executor)
    monkeypatch.setattr(node.get_logger(), "warning", said.append, raising=False)
    monkeypatch.setattr(type(node), "get_logger", lambda self: _Logger(said))
    run.spin([node], lambda: True, may_start=lambda: False)
    node.destroy_node()
    assert said == [run.UNTOLD]


class _Logger:
    def __init__(self, said: list[str]) -> None:
        self.warning = said.append
        self.info = self.error = lambda text: None


def test_the_recorder_counts_what_was_lost_without_senders_only_while_there_is_one(graph):
    topic = RecordedTopic(graph.probe, "/a", None, 10, lambda *message: None)
    for number in (1, 2, 5):
        topic._count_missed({"publication_sequence_number": number})
    assert topic.missed == 2
    topic.profiles = [{}, {}]
    topic._count_missed({"publication_sequence_number": 100})
    assert topic.missed == 2
