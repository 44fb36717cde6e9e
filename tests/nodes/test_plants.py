"""The simulated plants as nodes: they move when told to, and stop when what they are told is not usable."""

import math
import time

import pytest
from ros_graph import Graph, Sink, Source, stamp_of

from haptic_teleop_control.robots import OMNI_JOINTS, SFJ_JOINTS, SFJ_MOTOR_JOINTS
from haptic_teleop_sim.nodes.omni_sim import OmniSim
from haptic_teleop_sim.nodes.sfj_sim import SfjSim

PUSH = [2.0, 0.4]


class Setting:
    """The simulated 2DSFJ with a test that answers its states."""

    def __init__(self, graph: Graph, **parameters: object) -> None:
        self.graph = graph
        self.plant = graph.start(SfjSim, **{"timeout": 0.2, **parameters})
        self.states = Sink(graph, "/sfj/joint_states")
        self.command = Source(graph, "/sfj/effort_command", SFJ_MOTOR_JOINTS)
        graph.until(lambda: self.command.connected() and self.states.messages, what="discovery")

    def push(self, seconds: float = 0.1, effort=PUSH) -> None:
        """Answers every state for a while, as a controller would."""
        answered = len(self.states.messages)
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.graph.executor.spin_once(timeout_sec=0.01)
            if len(self.states.messages) > answered:
                answered = len(self.states.messages)
                self.send(effort=effort)

    def send(self, **fields: object) -> None:
        self.command.send(**{"stamp": stamp_of(self.states.last), "effort": PUSH, **fields})

    def flows(self) -> bool:
        """Whether a current flows in the plant itself, apart from what is measured of it."""
        return bool(self.plant.robot.flow.any())


def test_states_name_the_joints_and_their_stamps_advance_with_the_clock(graph):
    states = Setting(graph, rate=200.0).states
    first = len(states.messages)
    graph.until(lambda: len(states.messages) >= first + 40)
    gaps = [later - earlier for earlier, later in zip(states.stamps, states.stamps[1:], strict=False)]
    assert tuple(states.last.name) == SFJ_JOINTS
    assert min(gaps) > 0
    assert 4.5e6 < sum(gaps) / len(gaps) < 6.5e6
    assert abs(time.time_ns() - states.stamps[-1]) < 10**9


def test_before_the_first_command_nothing_flows_and_there_is_no_fault(graph):
    setting = Setting(graph)
    graph.run(0.3)
    assert not setting.flows()
    assert setting.plant.faults.latched is None


def test_a_positive_command_turns_the_joints_counter_clockwise(graph):
    setting = Setting(graph)
    setting.push(0.5)
    assert setting.flows()
    assert setting.plant.faults.latched is None
    assert min(setting.states.last.position) > 0.0


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_command_that_is_not_finite_stops_the_current_until_reset(graph, value):
    setting = Setting(graph)
    setting.push()
    assert setting.flows()
    setting.send(effort=[value, 0.0])
    graph.until(lambda: setting.plant.faults.latched)
    assert setting.plant.faults.latched == "non_finite_command"
    setting.push()
    assert not setting.flows(), "good commands after the fault must not drive it"
    assert graph.call("/sfj/sfj_sim/reset").success
    setting.push()
    assert setting.flows()


def test_a_controller_that_falls_silent_stops_the_current_within_the_timeout(graph):
    setting = Setting(graph, timeout=0.1)
    setting.push()
    assert setting.flows()
    silent = time.monotonic()
    graph.until(lambda: setting.plant.faults.latched)
    assert setting.plant.faults.latched == "stale_command"
    graph.run(0.01)
    assert not setting.flows()
    assert time.monotonic() - silent < 0.1 + 0.2


@pytest.mark.parametrize("age", [0.3, -0.3, None])
def test_a_command_that_answers_no_recent_state_is_stale(graph, age):
    setting = Setting(graph)
    setting.push()
    setting.send(stamp=0 if age is None else time.time_ns() - int(age * 1e9))
    graph.until(lambda: setting.plant.faults.latched)
    assert setting.plant.faults.latched == "stale_command"
    graph.run(0.02)
    assert not setting.flows()


def test_late_answers_while_the_graph_comes_up_drive_nothing_and_are_a_fault_only_if_they_go_on(graph):
    setting = Setting(graph)
    setting.send(stamp=1)
    graph.until(lambda: setting.plant.dropped == 1)
    assert setting.plant.faults.latched is None
    assert not setting.flows()
    graph.run(0.25)
    setting.send(stamp=1)
    graph.until(lambda: setting.plant.faults.latched == "stale_command")


def test_a_command_overtaken_by_a_newer_one_is_dropped(graph):
    setting = Setting(graph)
    stamp = stamp_of(setting.states.last)
    setting.command.send(stamp=stamp, effort=PUSH)
    setting.command.send(stamp=stamp - 2_000_000, effort=[-2.0, -0.4])
    graph.until(lambda: setting.plant.dropped == 1)
    assert list(setting.plant.commands.value["effort"]) == PUSH
    assert setting.plant.faults.latched is None


@pytest.mark.parametrize(
    "wrong", [{"names": SFJ_JOINTS}, {"names": ["stage1", "stage2"]}, {"effort": [1.0]}, {"effort": []}]
)
def test_wrong_joints_are_refused_by_name(graph, wrong):
    setting = Setting(graph)
    setting.send(**wrong)
    graph.until(lambda: setting.plant.faults.latched)
    assert setting.plant.faults.latched == "malformed_command"
    assert "/sfj/effort_command" in setting.plant.faults.sentence


def test_the_omni_moves_where_it_is_pushed(graph):
    plant = graph.start(OmniSim, timeout=0.2, rate=500.0)
    states = Sink(graph, "/omni/joint_states")
    command = Source(graph, "/omni/effort_command", OMNI_JOINTS)
    graph.until(lambda: command.connected() and states.messages)
    before = states.last.position[2]
    end = time.monotonic() + 0.3
    while time.monotonic() < end:
        command.send(stamp=stamp_of(states.last), effort=[0.0, 0.0, 0.1])
        graph.run(0.01)
    assert plant.faults.latched is None
    assert states.last.position[2] > before + 0.05
    assert tuple(states.last.name) == OMNI_JOINTS
