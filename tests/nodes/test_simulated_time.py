"""Simulated time where nodes meet it: whatever is wrong is a named refusal, or a fault with zero effort.

The wall, by which liveness counts, is held by the test.
"""

import math
import time

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from ros_graph import Graph, Sink, Source
from std_msgs.msg import String

from haptic_teleop_2dsfj.nodes.sfj_driver import SfjDriverNode
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.front_door import load
from haptic_teleop_control.node_tables import NODE_PARAMETERS
from haptic_teleop_control.nodes.base.haptic_node import HapticNode
from haptic_teleop_control.nodes.base.run import COORDINATOR_GONE
from haptic_teleop_control.nodes.force_controller import ForceController
from haptic_teleop_control.nodes.recorder import Recorder
from haptic_teleop_control.nodes.streams.joint_states import FIELDS, JointStatePublisher, JointStateReceiver
from haptic_teleop_control.nodes.time_coordinator import TimeCoordinator
from haptic_teleop_control.nodes.timing import time_base
from haptic_teleop_control.parameters import ParameterTable
from haptic_teleop_control.robots import SFJ_JOINTS, SFJ_MOTOR_JOINTS
from haptic_teleop_control.simulated_time.messages import (
    ANSWERER,
    HALTED,
    OVER,
    PAUSED,
    RUNNING,
    STATUS_TOPIC,
    WAITING,
    WITHDRAWN,
    Tick,
    decode,
)
from haptic_teleop_control.simulated_time.participant import COORDINATOR_LIVENESS
from haptic_teleop_control.simulated_time.stamps import LAST_WORD, ORIGIN, sample_stamp
from haptic_teleop_omni.nodes.omni_driver import OmniDriverNode
from haptic_teleop_sim.nodes.omni_sim import OmniSim
from haptic_teleop_sim.nodes.sfj_sim import SfjSim

PUSH = [2.0, 0.4]


class Answerer(HapticNode):
    """Answers the 2DSFJ's states with what `efforts` says: a list of (stamp after the state's, effort)."""

    NAME = "answerer"
    SUMMARY = "answers as a test says"
    TABLE = ParameterTable("answerer", NODE_PARAMETERS)

    def __init__(self, context: Context | None = None, **node_options) -> None:
        super().__init__(context, **node_options)
        self.efforts = [(0, PUSH)]
        self.out = JointStatePublisher(self, "/sfj/effort_command", SFJ_MOTOR_JOINTS, ("effort",))
        self.input = JointStateReceiver(self, "/sfj/joint_states", SFJ_JOINTS, FIELDS, self._on_state)

    def start(self) -> None:
        self.take_part(ANSWERER, topics=("/sfj/joint_states",))

    def _on_state(self) -> None:
        for later, effort in self.efforts:
            self.say(self.input.stamp + later, effort)

    def say(self, stamp: int, effort) -> None:
        self.out.view["effort"][:] = effort
        self.out.send(stamp)

    def on_tick(self, tick: Tick, repeated: bool) -> None:
        if repeated and self.out.sent and self.efforts:
            self.out.resend()


class Setting:
    """A plant, who answers it, and who grants time; as fast as it goes."""

    def __init__(self, graph: Graph, plant=SfjSim, answerer=Answerer, **coordinator: object) -> None:
        self.graph = graph
        self.plant = graph.start(plant, use_sim_time=True)
        self.answerer = graph.start(answerer, use_sim_time=True)
        names = [node.get_name() for node in (self.plant, self.answerer)]
        given = {"participants": names, "real_time_factor": 0.0, **coordinator}
        self.node = graph.start(TimeCoordinator, **given)
        self.coordinator = self.node._coordinator
        graph.until(lambda: self.plant.states.subscribers and self.plant.commands.publishers)

    def until_tick(self, number: int) -> None:
        self.let_live(lambda: self.coordinator.ticks >= number)

    def let_live(self, condition) -> None:
        """Until the condition holds, while the wall goes on by 10 ms at a time."""
        self.graph.until(lambda: self.graph.wall.advance(0.01) or condition())

    def flows(self) -> bool:
        return bool(self.plant.robot.flow.any())


@pytest.mark.parametrize("driver", [SfjDriverNode, OmniDriverNode])
def test_a_driver_of_hardware_takes_no_simulated_time(graph, driver):
    with pytest.raises(ConfigurationError, match="device hardware is hardware, whose time nobody can hold"):
        graph.make(driver, device="hardware", use_sim_time=True)


@pytest.mark.parametrize(("factor", "written"), [(-1.0, "-1.0"), (math.nan, ".nan"), (math.inf, ".inf")])
def test_a_real_time_factor_that_is_none_is_refused_at_the_start_and_while_it_runs(
    graph, factor, written, capsys
):
    assert load("time_coordinator")(["--ros-args", "-p", f"real_time_factor:={written}"]) == 2
    assert "real_time_factor" in capsys.readouterr().err
    setting = Setting(graph)
    (result,) = setting.node.set_parameters([Parameter("real_time_factor", value=factor)])
    assert not result.successful and "real_time_factor" in result.reason
    assert setting.node.values["real_time_factor"] == setting.coordinator.pace.factor == 0.0


def test_the_factor_may_change_while_it_runs(graph):
    setting = Setting(graph)
    (result,) = setting.node.set_parameters([Parameter("real_time_factor", value=2.0)])
    assert result.successful and setting.coordinator.pace.factor == 2.0


@pytest.mark.parametrize("node", [SfjSim, ForceController, TimeCoordinator])
@pytest.mark.parametrize("begun", [True, False])
def test_nobody_changes_between_the_wall_and_simulated_time_while_it_runs(graph, node, begun):
    changed = graph.make(node, use_sim_time=begun) if node is not TimeCoordinator else graph.make(node)
    before = changed.get_parameter("use_sim_time").value
    (result,) = changed.set_parameters([Parameter("use_sim_time", value=not before)])
    assert not result.successful and "use_sim_time" in result.reason
    assert changed.get_parameter("use_sim_time").value is before


def test_pause_holds_the_plant_a_step_moves_it_by_one_sample_and_a_step_while_running_is_refused(graph):
    setting = Setting(graph)
    setting.until_tick(20)
    refused = graph.call("/time_coordinator/step")
    assert not refused.success and "pause it before a step" in refused.message
    assert graph.call("/time_coordinator/pause").success
    setting.let_live(lambda: not setting.coordinator._busy)
    assert setting.flows()

    def seen() -> tuple:
        plant = setting.plant
        return setting.coordinator.stamp, plant.states.sent, plant.sampled, plant.robot.flow.tolist()

    held = seen()
    graph.wall.advance(3600.0)
    graph.listen(0.2)
    assert seen() == held and setting.coordinator.state == PAUSED
    assert graph.call("/time_coordinator/step").success
    setting.let_live(lambda: setting.coordinator.stamp > held[0] and not setting.coordinator._busy)
    graph.listen(0.2)
    assert seen()[:3] == (held[0] + 2_000_000, held[1] + 1, held[2] + 2_000_000)
    assert graph.call("/time_coordinator/resume").success
    setting.until_tick(100)
    assert setting.coordinator.state == RUNNING
    assert setting.plant.faults.latched is None


def test_who_never_answers_halts_time_is_named_and_the_robot_has_no_effort(graph):
    setting = Setting(graph, liveness=1.5)
    setting.until_tick(20)
    assert setting.flows()
    setting.answerer.efforts = []
    since = graph.wall.now()
    setting.let_live(lambda: setting.coordinator.state == HALTED)
    assert 1.0e9 < graph.wall.now() - since < 3.0e9, "ns of the wall: its liveness, and not much more"
    owes = "/answerer owes the answer to the state on /sfj/joint_states"
    assert owes in setting.coordinator.reason
    setting.let_live(lambda: setting.plant.faults.latched)
    assert setting.plant.faults.latched == "simulated_time" and owes in setting.plant.faults.sentence
    assert setting.plant.permitted() is None
    assert setting.node.faults.latched == "halted"


def test_a_controller_that_does_not_answer_sends_zero_when_time_is_halted(graph, monkeypatch):
    plants = [graph.start(SfjSim, use_sim_time=True), graph.start(OmniSim, use_sim_time=True, rate=500.0)]
    rates = {"master_rate": 500.0, "command_source": "device"}
    controller = graph.start(ForceController, use_sim_time=True, **rates)
    names = ["sfj_sim", "omni_sim", "force_controller"]
    node = graph.start(TimeCoordinator, participants=names, real_time_factor=0.0)
    alive = lambda condition: graph.until(lambda: graph.wall.advance(0.01) or condition())  # noqa: E731
    alive(lambda: node._coordinator.ticks > 50)
    monkeypatch.setattr(controller._answers, "advance", lambda repeated=False: None)
    alive(lambda: node._coordinator.state == HALTED)
    assert "/force_controller owes the answer" in node._coordinator.reason
    alive(lambda: all(plant.faults.latched and controller.faults.latched for plant in plants))
    for robot in controller._robots.values():
        assert robot.answered == robot.seen and not robot.effort.any()
    assert all(plant.permitted() is None for plant in plants)


@pytest.mark.parametrize(
    ("efforts", "fault"),
    [
        # A stamp that no state has: heard twice, a state's answer may meet the next state, and be right.
        ([(3_000_000, PUSH)], "future_command"),
        ([(0, PUSH), (0, [-2.0, -0.4])], "contradictory_command"),
        ([(0, [math.nan, 0.0])], "non_finite_command"),
    ],
)
def test_an_answer_that_cannot_be_is_a_fault_and_nothing_flows_until_a_reset(graph, efforts, fault):
    setting = Setting(graph)
    setting.until_tick(20)
    assert setting.flows()
    setting.answerer.efforts = efforts
    setting.let_live(lambda: setting.plant.faults.latched)
    assert setting.plant.faults.latched == fault
    setting.answerer.efforts = [(0, PUSH)]
    setting.answerer.say(setting.plant.sampled, PUSH)  # of the state that waits, if it does
    setting.until_tick(setting.coordinator.ticks + 5)
    assert not setting.flows()
    assert setting.coordinator.state == RUNNING
    assert graph.call("/sfj/sfj_sim/reset").success
    setting.until_tick(setting.coordinator.ticks + 5)
    assert setting.flows()


def test_a_command_of_a_node_that_takes_no_part_is_told_as_that(graph):
    plant = graph.start(SfjSim, use_sim_time=True)
    node = graph.start(TimeCoordinator, participants=["sfj_sim"], real_time_factor=0.0)
    outside = Source(graph, "/sfj/effort_command", SFJ_MOTOR_JOINTS, QoSProfile(depth=10))
    graph.until(lambda: graph.wall.advance(0.01) or node._coordinator.ticks > 20)
    assert graph.call("/time_coordinator/pause").success
    graph.until(lambda: graph.wall.advance(0.01) or not node._coordinator._busy)
    graph.until(outside.connected)
    outside.send(stamp=plant.sampled, effort=PUSH)
    graph.until(lambda: plant.faults.latched)
    assert plant.faults.latched == "uncoordinated_command"
    assert "takes no part in simulated time" in plant.faults.sentence


def test_who_grants_time_stamps_what_it_says_with_it_and_no_reset_lets_time_go_on(graph):
    told = []
    graph.probe.create_subscription(DiagnosticArray, "/diagnostics", told.append, 100)
    setting = Setting(graph, liveness=1.5)
    setting.until_tick(20)
    setting.answerer.efforts = []
    setting.let_live(lambda: setting.coordinator.state == HALTED)
    setting.let_live(lambda: told and told[-1].status[0].name == "/time_coordinator")
    stamp = told[-1].header.stamp.sec * 10**9 + told[-1].header.stamp.nanosec
    assert 0 < stamp <= setting.coordinator.stamp
    refused = graph.call("/time_coordinator/reset")
    assert not refused.success and "start it anew" in refused.message
    assert setting.node.faults.latched == "halted"


def test_an_answer_to_a_state_of_long_ago_is_dropped_and_the_right_one_taken(graph):
    setting = Setting(graph)
    setting.answerer.efforts = [(-4_000_000, [-2.0, -0.4]), (0, PUSH)]
    setting.until_tick(20)
    assert setting.plant.dropped >= 15
    assert setting.plant.faults.latched is None
    assert np.all(setting.plant.robot.flow > 0.0)


class Elsewhere:
    """A coordinator in another process, as far as the others can tell."""

    def __init__(self, graph: Graph, *participants: str) -> None:
        self.graph, self.context = graph, Context()
        self.context.init()
        given = {"participants": list(participants), "real_time_factor": 0.0}
        overrides = [Parameter(name, value=value) for name, value in given.items()]
        self.node = TimeCoordinator(context=self.context, wall=graph.wall, parameter_overrides=overrides)
        self.executor = type(graph.executor)(context=self.context)
        self.executor.add_node(self.node)
        self.node.start()

    def run(self, condition) -> None:
        def turn() -> object:
            self.graph.wall.advance(0.005)
            self.executor.spin_once(timeout_sec=0.002)
            return condition()

        self.graph.until(turn)

    def close(self) -> None:
        self.executor.remove_node(self.node)
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()


@pytest.fixture
def elsewhere(graph):
    coordinator = Elsewhere(graph, "sfj_sim")
    yield coordinator
    coordinator.close()


def test_a_coordinator_that_dies_is_a_fault_of_the_robot_that_says_so(graph, elsewhere):
    plant = graph.start(SfjSim, use_sim_time=True)
    elsewhere.run(lambda: elsewhere.node._coordinator.ticks > 20)
    before = graph.wall.now()
    graph.until(lambda: graph.wall.advance(0.01) or plant.faults.latched)
    assert plant.faults.latched == "simulated_time"
    assert "the coordinator of simulated time has been silent for" in plant.faults.sentence
    assert graph.wall.now() - before > 0.9e9 * COORDINATOR_LIVENESS
    assert plant.permitted() is None


def test_when_the_coordinator_dies_the_controller_says_zero_last_and_no_robot_takes_it_for_an_answer(graph):
    robots = [graph.start(plant, use_sim_time=True) for plant in (SfjSim, OmniSim)]
    controller = graph.start(ForceController, use_sim_time=True)
    heard = [Sink(graph, robot.commands.topic) for robot in robots]
    coordinator = Elsewhere(graph, "sfj_sim", "omni_sim", "force_controller")
    try:
        coordinator.run(lambda: coordinator.node._coordinator.ticks > 4)
        for node in (*robots, controller):
            node.time.participant._liveness = 1.0
        graph.until(lambda: graph.wall.advance(0.1) or all(n.faults.latched for n in (*robots, controller)))
        for robot, commands in zip(robots, heard, strict=True):
            graph.until(lambda robot=robot, heard=commands: heard.answer_to(robot.sampled + LAST_WORD))
            assert not any(commands.last.effort)
            assert robot.faults.counts["future_command"] == 0 and robot.permitted() is None
    finally:
        coordinator.close()


@pytest.mark.parametrize("cut_short", [False, True])
def test_a_controller_that_is_stopped_says_zero_last_only_where_time_was_cut_short(graph, cut_short):
    """That time is over may still be on its way: the recording would then hold a command too many."""
    for plant in (SfjSim, OmniSim):
        graph.start(plant, use_sim_time=True)
    controller = graph.start(ForceController, use_sim_time=True)
    coordinator = Elsewhere(graph, "sfj_sim", "omni_sim", "force_controller")
    try:
        coordinator.run(lambda: coordinator.node._coordinator.ticks > 4)
        outs = [robot.out for robot in controller._robots.values()]
        said = [out.sent for out in outs]
        stamps = [out._stamp for out in outs]
        if cut_short:
            controller.on_time_fault(COORDINATOR_GONE)
            controller.on_time_fault(COORDINATOR_GONE)
        controller.shutdown_safely()
        if cut_short:
            assert all(out.sent > n and out._stamp % 1000 == 1 for out, n in zip(outs, said, strict=True))
            assert not any(out.view["effort"].any() for out in outs)
        else:
            assert [out.sent for out in outs] == said and [out._stamp for out in outs] == stamps
    finally:
        coordinator.close()


@pytest.mark.parametrize("behind", [False, True])
def test_the_last_word_is_no_answer_and_stops_the_robot(graph, behind):
    """Also that of a controller which has not seen the newest state."""
    setting = Setting(graph)
    setting.until_tick(20)
    setting.answerer.efforts = []
    setting.let_live(lambda: setting.plant._awaiting)
    plant = setting.plant
    assert plant._driven and plant._answer_to < plant.sampled
    setting.answerer.say((plant._answer_to if behind else plant.sampled) + LAST_WORD, [0.0, 0.0])
    setting.let_live(lambda: not setting.plant._driven)
    assert setting.plant.faults.latched is None and setting.plant._awaiting
    assert setting.plant.permitted() is None


@pytest.mark.parametrize("deaf", [False, True])
def test_a_second_coordinator_in_the_domain_and_its_end_change_nothing(graph, elsewhere, deaf):
    """It withdraws as soon as it hears of the other one; as long as it does not, it waits and is ended."""
    plant = graph.start(SfjSim, use_sim_time=True)
    elsewhere.run(lambda: elsewhere.node._coordinator.ticks > 20)
    second, heard = Elsewhere(graph, "nobody"), []
    graph.probe.create_subscription(String, STATUS_TOPIC, lambda text: heard.append(decode(text.data)), 100)
    coordinator = second.node._coordinator
    if deaf:
        coordinator.yields_to = lambda other: False
    of_second = lambda state: any(  # noqa: E731
        status.session == coordinator.session and status.state == state for status in heard
    )
    try:
        noticed = (lambda: of_second(WAITING)) if deaf else (lambda: coordinator.state == WITHDRAWN)
        elsewhere.run(lambda: second.executor.spin_once(timeout_sec=0.0) or noticed())
        second.node.shutdown_safely()
        elsewhere.run(lambda: of_second(OVER) or not deaf)
        assert (second.node.failure is None) == deaf and (coordinator.state == OVER) == deaf
    finally:
        second.close()
    before = elsewhere.node._coordinator.ticks
    elsewhere.run(lambda: elsewhere.node._coordinator.ticks > before + 20)
    assert plant.faults.latched is None and plant.failure is None


def test_who_joins_late_is_refused_and_disturbs_nobody(graph):
    setting = Setting(graph)
    setting.until_tick(20)
    late = graph.start(OmniSim, use_sim_time=True, rate=500.0)
    setting.let_live(lambda: late.failure)
    assert "simulated time runs already" in str(late.failure)
    assert late.states.sent == 0
    setting.until_tick(setting.coordinator.ticks + 20)
    assert setting.coordinator.state == RUNNING and setting.plant.faults.latched is None


def test_without_a_coordinator_a_node_says_what_it_waits_for(graph):
    heard: list = []
    graph.probe.create_subscription(DiagnosticArray, "/diagnostics", heard.append, 10)
    plant = graph.start(SfjSim, use_sim_time=True)
    said: list[str] = []
    logger = plant.get_logger()
    logger.info = said.append
    plant.get_logger = lambda: logger
    graph.until(lambda: graph.wall.advance(0.1) or said, what="a line in the log")
    for _ in range(50):
        graph.wall.advance(0.1)
        graph.listen(0.01)
    assert len(said) == 1 and "no coordinator of simulated time" in said[0]
    assert "time_coordinator" in said[0]
    status = graph.until(lambda: heard and heard[-1].status[0], what="its diagnostics")
    values = {entry.key: entry.value for entry in status.values}
    assert values["state"] == "waiting for a coordinator of simulated time"
    node = graph.start(TimeCoordinator, participants=["sfj_sim", "omni_sim"], real_time_factor=0.0)
    graph.until(lambda: graph.wall.advance(0.01) or plant.time.participant.joined)
    assert plant._doing() == "waiting for omni_sim to take part (each with use_sim_time: true)"
    graph.start(OmniSim, use_sim_time=True)
    graph.until(lambda: graph.wall.advance(0.01) or node._coordinator.ticks > 3)
    assert plant._doing() == plant.state()


def test_diagnostics_go_on_without_ticks_and_with_the_wall_clock_set_back(graph, monkeypatch):
    """Nobody's `/clock`, and a machine whose clock was set back by an hour meanwhile."""
    heard: list = []
    graph.probe.create_subscription(DiagnosticArray, "/diagnostics", heard.append, 10)
    graph.start(SfjSim, use_sim_time=True)
    by_the_wall = graph.start(ForceController, wall=time_base.WallTime())

    def statuses(name: str) -> list[int]:
        return [
            m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in heard if m.status[0].name == name
        ]

    graph.until(lambda: statuses("/force_controller") and statuses("/sfj/sfj_sim"))
    now = time.time_ns()
    monkeypatch.setattr(time, "time_ns", lambda: now - 3600 * 10**9)
    monkeypatch.setattr(time, "time", lambda: now * 1e-9 - 3600.0)
    counts = {name: len(statuses(name)) for name in ("/force_controller", "/sfj/sfj_sim")}
    graph.until(lambda: all(len(statuses(name)) >= count + 2 for name, count in counts.items()))
    stamps = statuses("/force_controller")
    assert stamps == sorted(stamps)
    assert by_the_wall.get_clock().clock_type is not None


def test_a_recorder_flushes_and_ends_by_what_it_has_kept_whatever_the_wall_clock_says(
    graph, tmp_path, monkeypatch
):
    setting = Setting(graph, duration=0.0, paused=True)
    given = {"output": str(tmp_path / "bag"), "topics": ["/sfj/joint_states"], "duration": 0.5}
    overrides = [Parameter(name, value=value) for name, value in {**given, "use_sim_time": True}.items()]
    recorder = Recorder(context=graph.context, wall=graph.wall, parameter_overrides=overrides)
    graph.executor.add_node(recorder)
    now = time.time_ns()
    monkeypatch.setattr(time, "time_ns", lambda: now - 3600 * 10**9)
    try:
        recorder.begin()
        spin = lambda: recorder.spin_once(graph.executor)  # noqa: E731
        setting.let_live(lambda: spin() or "/recorder" in setting.coordinator.members)
        setting.let_live(lambda: spin() or setting.coordinator.state == PAUSED)
        assert setting.coordinator.resume() is None
        # The wall is held: a flush that is due before the pause would leave nothing for the one in question.
        graph.until(lambda: spin() or recorder.received.get("/sfj/joint_states", 0) > 100)
        setting.coordinator.pause()
        graph.until(lambda: spin() or not setting.coordinator._busy)
        flushed: list[int] = []
        flush = recorder.writer.flush
        monkeypatch.setattr(recorder.writer, "flush", lambda: (flush(), flushed.append(1)))
        graph.wall.advance(1.1)
        graph.until(lambda: spin() or flushed, what="a flush while time stands still")
        assert not recorder.stop
        setting.coordinator.resume()
        setting.let_live(lambda: spin() or recorder.stop)
        assert max(recorder._kept.values()) >= sample_stamp(250, 500.0) > ORIGIN
        assert recorder.status_stamp() == max(recorder._kept.values()), "and its diagnostics tell that time"
    finally:
        graph.executor.remove_node(recorder)
        recorder.shutdown_safely()
        recorder.destroy_node()
