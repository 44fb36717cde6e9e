"""`haptic-teleop set` and `echo` on running nodes: parameters change or are refused in a sentence, messages
come as YAML."""

import subprocess
import sys
import threading
import time
from array import array

import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future
from ros_graph import Graph
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from haptic_teleop_control import echo_topic, operate, set_parameter
from haptic_teleop_control.nodes import graph_client, operator_devices, topic_printer
from haptic_teleop_control.nodes.graph_client import known
from haptic_teleop_control.nodes.signal_generator import SignalGeneratorNode
from haptic_teleop_control.nodes.topic_printer import plain


class Spinning:
    """The graph's callbacks run in a thread while a command talks to it."""

    def __init__(self, graph: Graph) -> None:
        self._graph, self._over = graph, threading.Event()
        self._thread = threading.Thread(target=self._run)

    def _run(self) -> None:
        while not self._over.is_set():
            self._graph.executor.spin_once(timeout_sec=0.01)

    def __enter__(self) -> None:
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()


def test_set_changes_what_may_change_and_tells_what_may_not(graph, capsys):
    node = graph.make(SignalGeneratorNode)
    with Spinning(graph):
        # A whole number where the node wants a decimal one, and a bare name for the full one.
        assert set_parameter.main(["signal_generator", "stage1.step.amplitude", "-1"]) == 0
        assert capsys.readouterr().out == "/signal_generator: stage1.step.amplitude: 0.0 -> -1.0\n"
        assert set_parameter.main(["/signal_generator", "stage1.step.amplitude", "-1e-3"]) == 0
        capsys.readouterr()
        assert set_parameter.main(["signal_generator", "rate", "400.0"]) == 1
        assert "rate cannot change while the node runs" in capsys.readouterr().out
        assert set_parameter.main(["signal_generator", "stage1.step.amplitude", "abc"]) == 1
        assert "stage1.step.amplitude is a double (-0.001), not a string" in capsys.readouterr().out
        assert set_parameter.main(["signal_generator", "stage1.step.amplitud", "1.0"]) == 2
        assert "did you mean stage1.step.amplitude" in capsys.readouterr().err
        assert set_parameter.main(["sinal_generator", "rate", "1.0", "--wait", "0.3"]) == 2
        assert "no node sinal_generator is found within 0.3 s; " in capsys.readouterr().err
    assert node.values["stage1.step.amplitude"] == -1e-3


def test_set_refuses_a_value_that_is_none(capsys):
    assert set_parameter.main(["signal_generator", "rate", "{a: 1}"]) == 2
    assert "write a number, true, a text or a list" in capsys.readouterr().err


def test_echo_prints_the_latest_of_what_is_kept_for_late_comers(graph, capsys):
    kept = QoSProfile(depth=5, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publisher = graph.probe.create_publisher(String, "/probe/state", kept)
    for state in ("off", "devices_ready"):
        publisher.publish(String(data=state))
    assert echo_topic.main(["probe/state", "--once"]) == 0
    assert capsys.readouterr().out == "data: devices_ready\n---\n"
    assert echo_topic.main(["/probe/stat", "--once", "--wait", "0.3"]) == 2
    assert "nobody publishes /probe/stat within 0.3 s; " in capsys.readouterr().err


def test_echo_says_that_nothing_comes_and_prints_what_comes_then(graph, capsys, monkeypatch):
    publisher = graph.probe.create_publisher(String, "/probe/state", 5)
    said = topic_printer._silent

    def silent(*given):
        publisher.publish(String(data="at last"))
        return said(*given)

    monkeypatch.setattr(topic_printer, "_silent", silent)
    monkeypatch.setattr(topic_printer, "POLL", 0.1)
    monkeypatch.setattr(topic_printer, "QUIET", 0.3)
    assert echo_topic.main(["/probe/state", "--once"]) == 0
    printed = capsys.readouterr()
    assert printed.out == "data: at last\n---\n"
    assert "nothing has come on /probe/state in 0.3 s, which /probe can publish on; " in printed.err


@pytest.mark.parametrize("act", ["state", "engage", "devices"])
def test_operate_says_what_it_waits_for_and_then_what_to_do(monkeypatch, capsys, act):
    monkeypatch.setattr(graph_client, "SILENT", 0.05)
    assert operate.main([act, "--wait", "0.3"]) == 2
    first, last = capsys.readouterr().err.splitlines()
    waited_for = "a driver" if act == "devices" else "/force_controller"
    assert first == f"waiting for {waited_for}, at most 0.3 s ..."
    assert last.startswith("error: ") and "start a scenario" in last


@pytest.mark.parametrize("wait", ["nan", "-1", "0", "inf", "long"])
@pytest.mark.parametrize("command", [(operate, "state"), (set_parameter, "a", "b", "1"), (echo_topic, "/a")])
def test_a_wait_that_is_no_time_is_refused_at_once(capsys, command, wait):
    program, *arguments = command
    assert program.main([*arguments, f"--wait={wait}"]) == 2
    assert f"{wait!r} is not a number above zero" in capsys.readouterr().err


def test_a_name_that_is_not_there_is_answered_with_those_that_are():
    # Without a graph: what has been discovered when the wait is over is the machine's affair.
    assert known(["/signal_generator", "/link"], "sinal_generator") == "did you mean /signal_generator?"
    assert known(["/b", "/a"], "xyz") == "there are /a, /b."
    assert "start a scenario with the same ROS_DOMAIN_ID" in known([], "xyz")


def test_a_joint_state_is_printed_with_all_its_fields_and_numbers():
    message = JointState(name=["a", "b"], position=array("d", [0.1, -2.0]))
    message.header.stamp.sec = 7
    told = yaml.safe_load(yaml.safe_dump(plain(message)))
    assert told == {
        "header": {"stamp": {"sec": 7, "nanosec": 0}, "frame_id": ""},
        "name": ["a", "b"], "position": [0.1, -2.0], "velocity": [], "effort": [],
    }  # fmt: skip


@pytest.mark.parametrize("count", ["0", "-1", "many"])
def test_echo_wants_a_number_of_messages(count, capsys):
    assert echo_topic.main(["/state", "--count", count]) == 2
    assert "--count" in capsys.readouterr().err


def test_a_question_whose_answer_was_lost_is_asked_anew():
    asked: list[Future] = []

    def question() -> Future:
        asked.append(Future())
        if len(asked) == 3:
            asked[0].set_result("late")
        return asked[-1]

    client = graph_client.GraphClient("asking")
    try:
        assert client.ask(question, time.monotonic() + 20.0) == "late" and len(asked) == 3
        assert client.ask(Future, time.monotonic() + 0.1) is None
    finally:
        client.close()


def test_a_command_ends_also_where_the_middleware_hangs_while_it_leaves():
    """With what it has to say, and its exit status."""
    program = (
        "import sys, time\n"
        "from haptic_teleop_control import operate\n"
        "from haptic_teleop_control.nodes import graph_client\n"
        "graph_client.LEAVING = 0.2\n"
        "graph_client.GraphClient.close = lambda self: time.sleep(3600.0)\n"
        "sys.exit(operate.main(['engage', '--wait', '0.3']))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert done.returncode == 2 and "start a scenario" in done.stderr


def test_operate_devices_names_who_is_there_and_says_nothing(graph, monkeypatch, capsys):
    monkeypatch.setattr(operator_devices, "ROUND", 0.5)
    driver = graph.probe.create_publisher(DiagnosticArray, "/diagnostics", 10)
    values = [KeyValue(key="device", value="emulated")]
    status = DiagnosticStatus(name="/omni/omni_driver", message="running", values=values)
    graph.probe.create_timer(0.05, lambda: driver.publish(DiagnosticArray(status=[status])))
    silent = Node("sfj_driver", context=graph.probe.context, start_parameter_services=False)
    silent.create_publisher(DiagnosticArray, "/diagnostics", 10)
    with Spinning(graph):
        assert operate.main(["devices"]) == 1
    silent.destroy_node()
    told = capsys.readouterr().out
    assert told.startswith("/omni/omni_driver: device emulated: running\n")
    assert "/sfj_driver: there, but not heard for 0.5 s" in told
