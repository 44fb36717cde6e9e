"""Joint states travel as bytes: what the middleware writes is what we read, and the reverse."""

from array import array

import numpy as np
import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState

from haptic_teleop_control.nodes.streams.joint_states import (
    NON_FINITE,
    WRONG_JOINTS,
    JointStatePublisher,
    JointStateReceiver,
)
from haptic_teleop_control.recording.cdr_layout import find_layout

JOINTS = ("a", "motor", "c")
FIELDS = ("position", "effort")


@pytest.fixture
def node(ros_isolation):
    context = Context()
    rclpy.init(context=context)
    node = Node("streams", context=context)
    yield node
    node.destroy_node()
    context.try_shutdown()


def on_the_wire(message):
    """Its bytes, without those that rclpy appends where it serializes into memory."""
    data = bytes(serialize_message(message))
    while True:
        try:
            find_layout(data)
            return data
        except ValueError:
            data = data[:-1]


class Heard:
    """A receiver that is fed by hand."""

    def __init__(self, node):
        self.problems, self.samples = [], 0
        self.receiver = JointStateReceiver(node, "states", JOINTS, FIELDS, self._count, self._note)

    def _count(self):
        self.samples += 1

    def _note(self, kind, detail, stamp):
        self.problems.append((kind, stamp))

    def take(self, message):
        self.receiver._receive(message if isinstance(message, bytes) else on_the_wire(message), {})

    @property
    def values(self):
        return [self.receiver.value[field].tolist() for field in FIELDS]


def state(k, names=JOINTS, frame="", **fields):
    values = {"position": [k + 0.1, k + 0.2, k + 0.3], "effort": [-k, 0.0, k]} | fields
    message = JointState(name=list(names), **{key: array("d", value) for key, value in values.items()})
    message.header.stamp.sec, message.header.stamp.nanosec, message.header.frame_id = k, 10 * k, frame
    return message


def test_what_we_send_is_read_by_the_middleware_as_it_was_meant(node):
    out, sent = JointStatePublisher(node, "commands", JOINTS, FIELDS), []
    out._publish = sent.append
    out.view["position"][:] = [1.0, 2.0, 3.0]
    out.view["effort"][:] = [0.0, np.pi, -5e-324]
    out.send(12_000_000_034)
    out.resend()
    message = deserialize_message(sent[0], JointState)
    assert sent[0] == sent[1] and list(message.name) == list(JOINTS) and message.header.frame_id == ""
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (12, 34)
    assert list(message.position) == [1.0, 2.0, 3.0] and list(message.velocity) == []
    assert list(message.effort) == [0.0, np.pi, -5e-324]
    out.send_zero(1)
    assert list(deserialize_message(sent[2], JointState).effort) == [0.0, 0.0, 0.0]


def test_every_layout_is_read_whatever_came_before(node):
    heard = Heard(node)
    turned = ("c", "a", "motor")
    sequence = [
        state(1),
        state(2),
        state(3, frame="base"),
        state(4, names=turned),
        state(5, names=turned),
        state(6),
        state(7, velocity=[1.0, 2.0, 3.0]),
        state(8),
    ]
    for number, message in enumerate(sequence, start=1):
        heard.take(message)
        assert heard.receiver.stamp == number * 1_000_000_010
        order = [list(message.name).index(joint) for joint in JOINTS]
        assert heard.values == [[getattr(message, field)[i] for i in order] for field in FIELDS]
    assert heard.samples == len(sequence) and heard.problems == []


@pytest.mark.parametrize("before", [0, 1, 2], ids=["at first", "after one", "after two"])
@pytest.mark.parametrize(
    ("wrong", "kind"),
    [
        (state(9, position=[1.0, float("nan"), 2.0]), NON_FINITE),
        (state(9, effort=[float("inf"), 0.0, 0.0]), NON_FINITE),
        (state(9, effort=[]), WRONG_JOINTS),
        (state(9, effort=[1.0, 2.0]), WRONG_JOINTS),
        (state(9, names=("a", "motor", "d")), WRONG_JOINTS),
    ],
)
def test_a_wrong_sample_changes_nothing_and_is_told_with_its_stamp(node, before, wrong, kind):
    heard = Heard(node)
    for k in range(before):
        heard.take(state(k + 1))
    values = heard.values
    heard.take(wrong)
    assert heard.problems == [(kind, 9_000_000_090)]
    assert heard.values == values and heard.samples == before
    heard.take(state(10))
    assert heard.samples == before + 1 and heard.receiver.stamp == 10_000_000_100


def test_bytes_that_are_no_joint_state_are_told_and_never_an_exception(node):
    heard = Heard(node)
    heard.take(state(1))
    whole = on_the_wire(state(2))
    for data in (b"", b"\0\1", whole[:20], b"\0\1\0\0" + b"\xff" * 60):
        heard.take(data)
    assert heard.samples == 1 and {kind for kind, _ in heard.problems} == {WRONG_JOINTS}
    assert len(heard.problems) == 4


def test_the_second_message_of_a_sender_is_read_in_place(node, monkeypatch):
    heard = Heard(node)
    heard.take(state(1))
    monkeypatch.setattr(heard.receiver, "_examine", lambda *given: pytest.fail("made a message object"))
    heard.take(state(2))
    assert heard.samples == 2
