"""The signal generator in a graph: started, changed while it runs, refused, stopped."""

import pytest
from rclpy.parameter import Parameter
from ros_graph import Graph, Sink

from haptic_teleop_control.nodes.signal_generator import SignalGeneratorNode

STEP = {"stage1__enabled": True, "stage1__step__enabled": True, "stage1__step__amplitude": 0.05}


def change(node, **values):
    (result,) = node.set_parameters([Parameter(k.replace("__", "."), value=v) for k, v in values.items()])
    return result


@pytest.mark.parametrize(
    ("duration", "said"), [(3.0, "ends after 3 s"), (float("inf"), "goes on until it is stopped")]
)
def test_who_starts_it_is_told_when_it_ends(graph: Graph, duration, said):
    graph.start(SignalGeneratorNode, autostart=False, stage1__duration=duration, **STEP)
    answer = graph.call("/signal_generator/start")
    assert answer.success
    assert said in answer.message


def test_it_is_zero_until_started_follows_a_change_at_once_and_refuses_a_bad_one(graph: Graph):
    node = graph.start(SignalGeneratorNode, autostart=False, **STEP)
    reference = Sink(graph, "/reference")
    graph.until(reference.connected)
    graph.run(0.02)
    graph.until(lambda: len(reference.messages) > 5, what="references")
    assert all(list(message.position) == [0.0, 0.0] for message in reference.messages)
    graph.call("/signal_generator/start")
    graph.run_until(lambda: list(reference.last.position) == [0.05, 0.0], what="the step")
    assert change(node, stage1__step__amplitude=0.07).successful
    graph.run_until(lambda: list(reference.last.position) == [0.07, 0.0], what="the change")
    for bad in (float("nan"), float("inf")):
        refused = change(node, stage1__step__amplitude=bad)
        assert not refused.successful
        assert "stage1.step.amplitude" in refused.reason
    graph.run(0.1)
    graph.until(lambda: len(reference.messages) == node._out.sent)
    assert list(reference.last.position) == [0.07, 0.0]
    graph.call("/signal_generator/stop")
    graph.run_until(lambda: list(reference.last.position) == [0.0, 0.0], what="zero")
