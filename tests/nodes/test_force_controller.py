"""The controller as a node of a real ROS graph; the numbers expected are worked out by hand from the
equations."""

import math
from itertools import pairwise

import pytest
from rclpy.parameter import Parameter
from ros_graph import Graph, Sink, Source

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.nodes.force_controller import ForceController
from haptic_teleop_control.robots import OMNI_JOINTS, SFJ_JOINTS

REST = {"position": [0.0] * 4, "velocity": [0.0] * 4, "effort": [0.0] * 4}
NO_EFFORT = [0.0, 0.0]
TOO_LONG = 0.051
"""s; a stream may be silent for 0.05 s."""


class Setting:
    """A controller with everything around it that it listens to, published by the test."""

    def __init__(self, graph: Graph, **parameters: object) -> None:
        self.graph = graph
        at_once = {"ramp_time": 0.0, "ramp_out_time": 0.0, "align__speed": 10.0}
        self.controller = graph.start(ForceController, **{**at_once, **parameters})
        self.slave = Source(graph, "/sfj/joint_states", SFJ_JOINTS)
        self.master = Source(graph, "/omni/joint_states", OMNI_JOINTS)
        self.reference = Source(graph, "/reference", ["omni_y", "omni_z"])
        self.effort = Sink(graph, "/sfj/effort_command")
        self.device = Sink(graph, "/omni/effort_command")
        ends = (self.slave, self.master, self.reference, self.effort, self.device)
        graph.until(lambda: all(end.connected() for end in ends), what="discovery")

    def answer(self, **fields: object):
        """The command that answers a new state of the slave, 2 ms after the last one."""
        self.graph.wall.advance(0.002)
        stamp = self.slave.send(**{**REST, **fields})
        return self.graph.until(lambda: self.effort.answer_to(stamp), what="an answer")

    def hold(self, angles):
        """A state of the device at these angles; its stamp."""
        return self.master.send(position=angles, velocity=[0.0] * 3, effort=[0.0] * 3)

    def answer_with_reference(self, angles=(0.006, 0.0), **fields: object):
        seen = self.controller._reference.count
        self.reference.send(position=angles)
        self.graph.until(lambda: self.controller._reference.count > seen, what="the reference")
        return self.answer(**fields)


def test_every_state_is_answered_with_its_own_stamp(graph):
    setting = Setting(graph)
    for _ in range(50):
        setting.answer()
    assert setting.effort.stamps == setting.slave.stamps
    assert list(setting.effort.last.name) == ["stage1_motor", "stage2_motor"]


def test_without_a_reference_the_effort_is_zero_and_there_is_no_fault(graph):
    setting = Setting(graph)
    assert list(setting.answer().effort) == NO_EFFORT
    assert setting.controller.faults.latched is None


def test_the_first_effort_is_that_of_equations_25_to_32(graph):
    # Td = 10 * 0.006 = 0.06; s = Td at rest; Ic = Kpm/Ks (Kp s + Ki s dt); effort = Ic * torque constant.
    effort = Setting(graph).answer_with_reference((0.006, 0.008)).effort
    first = 5.0 / 3.971 * (2.0 * 0.06 + 10.0 * 0.06 * 0.002) * 8.925
    second = 5.0 / 3.891 * (2.0 * 0.08 + 10.0 * 0.08 * 0.002) * 1.392
    assert list(effort) == pytest.approx([first, second], rel=1e-9)


def test_joints_in_another_order_give_the_same_answer(graph):
    setting = Setting(
        graph, stage1__ki=0.0, stage2__ki=0.0
    )  # without integrator, equal states get equal answers
    order = [2, 0, 3, 1]
    state = {"position": [0.02, 0.0, -0.01, 0.01], "velocity": [0.5, 0.0, -0.2, 0.0], "effort": [0.0] * 4}
    shuffled = {field: [values[i] for i in order] for field, values in state.items()}
    expected = list(setting.answer_with_reference(**state).effort)
    answer = setting.answer_with_reference(names=[SFJ_JOINTS[i] for i in order], **shuffled)
    assert list(answer.effort) == expected
    assert 0.0 not in expected


def test_output_ramps_in_after_the_start(graph):
    setting = Setting(graph, ramp_time=0.4)
    early = setting.answer_with_reference().effort[0]
    for _ in range(200):
        setting.answer_with_reference()
    late = setting.answer_with_reference().effort[0]
    assert setting.controller.faults.latched is None
    full = 5.0 / 3.971 * 2.0 * 0.06 * 8.925
    assert 0.0 <= early < 0.5 * full
    assert late > full


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("field", ["position", "velocity", "effort"])
def test_a_state_that_is_not_finite_gives_zero_and_latches_until_reset(graph, field, value):
    setting = Setting(graph)
    assert setting.answer_with_reference().effort[0] > 0.0
    assert list(setting.answer_with_reference(**{field: [0.0, value, 0.0, 0.0]}).effort) == NO_EFFORT
    assert setting.controller.faults.latched == "non_finite_state"
    assert list(setting.answer_with_reference().effort) == NO_EFFORT
    assert graph.call("/force_controller/reset").success
    assert setting.controller.faults.counts["non_finite_state"] == 1
    assert setting.answer_with_reference().effort[0] > 0.0


def test_a_reference_that_is_not_finite_gives_zero_and_latches(graph):
    setting = Setting(graph)
    assert setting.answer_with_reference().effort[0] > 0.0
    setting.reference.send(position=[math.nan, 0.0])
    graph.until(lambda: setting.controller.faults.latched == "non_finite_state")
    assert list(setting.answer_with_reference().effort) == NO_EFFORT


@pytest.mark.parametrize(
    "wrong",
    [
        {"names": ["a", "b", "c", "d"]},
        {"names": SFJ_JOINTS[:3]},
        {"names": ["stage1_motor", "stage1_motor", "stage2_motor", "stage2_arm"]},
        {"position": [0.0] * 3},
        {"velocity": []},
        {"effort": [0.0] * 5},
    ],
)
def test_wrong_joints_or_lengths_give_zero_and_name_the_topic(graph, wrong):
    setting = Setting(graph)
    assert setting.answer_with_reference().effort[0] > 0.0
    assert list(setting.answer(**wrong).effort) == NO_EFFORT
    assert setting.controller.faults.latched == "malformed_state"
    assert "/sfj/joint_states" in setting.controller.faults.sentence


def test_a_silent_reference_gives_zero_and_latches(graph):
    setting = Setting(graph)
    assert setting.answer_with_reference().effort[0] > 0.0
    graph.wall.advance(TOO_LONG)
    assert list(setting.answer().effort) == NO_EFFORT
    assert setting.controller.faults.latched == "stale_reference"


def test_a_silent_slave_takes_the_torque_from_the_master(graph):
    setting = Setting(graph, omni_y__spring=0.3)
    setting.answer_with_reference()
    stamp = setting.hold([0.0, 0.1, 0.0])
    felt = graph.until(lambda: setting.device.answer_to(stamp)).effort
    assert list(felt) == pytest.approx([0.0, -0.03, 0.0])
    graph.wall.advance(TOO_LONG)
    stamp = setting.hold([0.0, 0.1, 0.0])
    assert list(graph.until(lambda: setting.device.answer_to(stamp)).effort) == [0.0, 0.0, 0.0]
    assert setting.controller.faults.latched == "stale_slave"


def test_time_that_jumps_back_gives_zero_and_latches(graph):
    setting = Setting(graph)
    now = graph.wall.stamp()
    assert setting.answer_with_reference(stamp=now).effort[0] > 0.0
    assert list(setting.answer_with_reference(stamp=now - 5 * 10**9).effort) == NO_EFFORT
    assert setting.controller.faults.latched == "time_jump"


def test_a_state_that_was_overtaken_is_dropped_without_a_fault(graph):
    setting = Setting(graph)
    now = graph.wall.stamp()
    assert setting.answer_with_reference(stamp=now).effort[0] > 0.0
    setting.slave.send(stamp=now - 2_000_000, **REST)
    graph.until(lambda: setting.controller.dropped == 1)
    assert setting.controller.faults.latched is None
    assert now - 2_000_000 not in setting.effort.stamps


def test_in_manual_mode_the_device_commands(graph):
    setting = Setting(graph, command_source="device")
    stamp = setting.hold([0.0, 0.006, 0.0])
    graph.until(lambda: setting.device.answer_to(stamp))
    assert setting.answer().effort[0] == pytest.approx(5.0 / 3.971 * 2.02 * 0.06 * 8.925)
    graph.wall.advance(TOO_LONG)
    assert list(setting.answer().effort) == NO_EFFORT
    assert setting.controller.faults.latched == "stale_master"


def test_felt_torque_stays_within_what_the_device_can_give(graph):
    setting = Setting(graph, omni_z__spring=100.0, omni_z__torque_limit=0.446)
    setting.answer_with_reference()
    stamp = setting.hold([0.0, 0.0, -1.0])
    assert list(graph.until(lambda: setting.device.answer_to(stamp)).effort) == [0.0, 0.0, 0.446]


def test_one_robot_cannot_be_both_master_and_slave(graph):
    with pytest.raises(ConfigurationError, match=r"master and slave are both sfj"):
        graph.start(ForceController, master="sfj", slave="sfj")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("stage1.kp", math.nan),
        ("stage1.kp", -1.0),
        ("stage1.lambda", 0.0),
        ("timeout", 0.1),
        ("master", "sfj"),
    ],
)
def test_a_bad_parameter_is_refused_with_a_reason_and_changes_nothing(graph, name, value):
    controller = graph.start(ForceController)
    before = controller.get_parameter(name).value
    result = controller.set_parameters([Parameter(name, value=value)])[0]
    assert not result.successful
    assert name in result.reason
    assert "force_controller" not in result.reason, "who asked knows whom"
    assert controller.get_parameter(name).value == before


def test_a_good_parameter_changes_the_law_while_it_runs(graph):
    setting = Setting(graph)
    assert setting.controller.set_parameters([Parameter("stage1.kp", value=1.0)])[0].successful
    effort = setting.answer_with_reference().effort[0]
    assert effort == pytest.approx(5.0 / 3.971 * (1.0 * 0.06 + 10.0 * 0.06 * 0.002) * 8.925)


def test_a_master_gain_changed_while_running_moves_the_effort_in_small_steps(graph):
    setting = Setting(graph, stage1__ki=0.0, stage2__ki=0.0)  # without integrator only the gain moves it
    before = setting.answer_with_reference().effort[0]
    (done,) = setting.controller.set_parameters([Parameter("omni_y.torque_gain", value=20.0)])
    assert done.successful, done.reason
    course = [before]
    for _ in range(130):  # the ramp takes 0.2 s of samples of 2 ms
        course.append(setting.answer_with_reference().effort[0])
    assert course[-1] == pytest.approx(2.0 * before, rel=1e-9)
    assert max(abs(b - a) for a, b in pairwise(course)) < 0.02 * before
