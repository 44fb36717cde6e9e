"""The simulated plants as nodes: they move when told to, and stop when what they are told is not usable."""

import math
import time
from itertools import pairwise

import pytest
from rclpy.qos import qos_profile_sensor_data
from ros_graph import Commanded, Graph, Sink, stamp_of
from sensor_msgs.msg import JointState

from haptic_teleop_control.nodes.timing.time_base import WallTime
from haptic_teleop_control.robots import OMNI_JOINTS, SFJ_JOINTS, SFJ_MOTOR_JOINTS
from haptic_teleop_sim.nodes.omni_sim import OmniSim
from haptic_teleop_sim.nodes.sfj_sim import SfjSim

PUSH = [2.0, 0.4]


class Setting(Commanded):
    """The simulated 2DSFJ with a test that answers its states."""

    def __init__(self, graph: Graph, **parameters: object) -> None:
        super().__init__(graph, SfjSim, SFJ_MOTOR_JOINTS, **parameters)

    def push(self, seconds: float = 0.04) -> None:
        self.answer(seconds, PUSH)

    def flows(self) -> bool:
        """Whether a current flows in the plant itself, apart from what is measured of it."""
        return bool(self.node.robot.flow.any())


def test_states_name_the_joints_and_their_stamps_are_those_of_the_deadlines(graph):
    setting = Setting(graph, rate=200.0)
    for _ in range(40):
        setting.state()
    stamps = setting.states.stamps[-40:]
    assert tuple(setting.states.last.name) == SFJ_JOINTS
    assert {later - earlier for earlier, later in pairwise(stamps)} == {5_000_000}
    assert stamps[-1] == graph.wall.stamp()


def test_by_the_machine_s_clock_the_stamps_are_those_of_now_and_never_closer_than_the_clock_went(graph):
    """Also on a machine that is late: then periods are skipped and counted."""
    states = Sink(graph, "/sfj/joint_states")
    before = time.monotonic_ns()
    plant = graph.start(SfjSim, wall=WallTime(), rate=200.0)
    graph.until(lambda: len(states.messages) >= 40)
    assert plant.thread.stop()
    elapsed = time.monotonic_ns() - before
    sent = plant.thread.cycles + plant.thread.overruns
    assert sent * 5e6 <= elapsed + 5e6, "not faster than its rate"
    gaps = [later - earlier for earlier, later in pairwise(states.stamps)]
    assert min(gaps) > 0
    assert sum(gaps) <= elapsed
    assert WallTime().stamp() - elapsed <= states.stamps[0] <= states.stamps[-1] <= WallTime().stamp()


def test_before_the_first_command_nothing_flows_and_there_is_no_fault(graph):
    setting = Setting(graph)
    graph.run(0.3)
    assert not setting.flows()
    assert setting.node.faults.latched is None


def test_a_positive_command_turns_the_joints_counter_clockwise(graph):
    setting = Setting(graph)
    setting.push(0.5)
    assert setting.flows()
    assert setting.node.faults.latched is None
    assert min(setting.states.last.position) > 0.0


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_command_that_is_not_finite_stops_the_current_until_reset(graph, value):
    setting = Setting(graph)
    setting.push()
    assert setting.flows()
    setting.send(effort=[value, 0.0])
    assert setting.node.faults.latched == "non_finite_command"
    setting.push()
    assert not setting.flows(), "good commands after the fault must not drive it"
    assert graph.call("/sfj/sfj_sim/reset").success
    setting.push()
    assert setting.flows()


def test_a_controller_that_falls_silent_stops_the_current_within_the_timeout(graph):
    setting = Setting(graph, timeout=0.1)
    setting.push()
    assert setting.flows()
    silent = graph.wall.now()
    graph.run_until(lambda: setting.node.faults.latched)
    assert setting.node.faults.latched == "stale_command"
    setting.state()
    assert not setting.flows()
    assert graph.wall.now() - silent <= 0.1e9 + 2 * 2e6, "ns: the timeout and two samples"


def test_a_subscription_for_sensor_data_hears_the_states(graph):
    heard = []
    graph.probe.create_subscription(JointState, "/sfj/joint_states", heard.append, qos_profile_sensor_data)
    Setting(graph)
    graph.run_until(lambda: len(heard) > 3)


def test_a_stall_is_simulated_afterwards_with_no_current_and_is_a_fault(graph):
    """As on a machine that stands still for longer than a command holds; what the robot does meanwhile
    counts."""
    setting = Setting(graph)
    setting.push()
    cycles = setting.node.thread.cycles
    graph.until(lambda: graph.wall.settled)
    graph.wall.advance(0.3)
    graph.until(lambda: setting.node.thread.cycles > cycles)
    assert setting.node.faults.latched == "stale_command"
    assert setting.node.thread.overruns == 149
    assert not setting.flows()
    assert setting.node.lost_steps == 0


@pytest.mark.parametrize(
    ("age", "fault", "said"),
    [
        (0.3, "stale_command", "0.300 s old"),
        (-0.3, "future_command", "0.300 s ahead"),
        (None, "stale_command", "without a stamp"),
    ],
)
def test_a_command_that_answers_no_recent_state_is_stale_or_from_the_future(graph, age, fault, said):
    setting = Setting(graph)
    setting.push()
    setting.send(effort=PUSH, stamp=0 if age is None else graph.wall.stamp() - int(age * 1e9))
    assert setting.node.faults.latched == fault and said in setting.node.faults.sentence
    setting.state()
    assert not setting.flows()


def test_late_answers_while_the_graph_comes_up_drive_nothing_and_are_a_fault_only_if_they_go_on(graph):
    setting = Setting(graph)
    setting.send(effort=PUSH, stamp=1)
    assert setting.node.dropped == 1
    assert setting.node.faults.latched is None
    assert not setting.flows()
    graph.run(0.19)
    setting.send(effort=PUSH, stamp=1)
    assert setting.node.faults.latched is None
    graph.run(0.02)
    setting.send(effort=PUSH, stamp=1)
    assert setting.node.faults.latched == "stale_command"


def test_a_command_overtaken_by_a_newer_one_is_dropped(graph):
    setting = Setting(graph)
    stamp = stamp_of(setting.states.last)
    setting.send(effort=PUSH, stamp=stamp)
    setting.send(stamp=stamp - 2_000_000, effort=[-2.0, -0.4])
    assert setting.node.dropped == 1
    assert list(setting.node.commands.value["effort"]) == PUSH
    assert setting.node.faults.latched is None


@pytest.mark.parametrize(
    "wrong", [{"names": SFJ_JOINTS}, {"names": ["stage1", "stage2"]}, {"effort": [1.0]}, {"effort": []}]
)
def test_wrong_joints_are_refused_by_name(graph, wrong):
    setting = Setting(graph)
    setting.send(**{"effort": PUSH, **wrong})
    assert setting.node.faults.latched == "malformed_command"
    assert "/sfj/effort_command" in setting.node.faults.sentence


def test_the_omni_moves_where_it_is_pushed(graph):
    setting = Commanded(graph, OmniSim, OMNI_JOINTS, rate=500.0)
    before = setting.states.last.position[2]
    setting.answer(0.3, [0.0, 0.0, 0.1])
    assert setting.node.faults.latched is None
    assert setting.states.last.position[2] > before + 0.05
    assert tuple(setting.states.last.name) == OMNI_JOINTS
