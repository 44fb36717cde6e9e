"""What a scenario relies on at its start: nothing compiles any more, and nobody misses the first message."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import pytest
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.service import Service
from sensor_msgs.msg import JointState

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.nodes.base.registry import node_names
from haptic_teleop_control.nodes.launching import starter as starter_module
from haptic_teleop_control.nodes.launching.children import Child
from haptic_teleop_control.nodes.launching.connections import (
    IN,
    OUT,
    PARTICIPANTS,
    endpoints,
    merged,
    strangers,
    unconnected,
)
from haptic_teleop_control.nodes.launching.starter import Starter
from haptic_teleop_control.nodes.launching.stopping import StopRequests, stop_requests
from haptic_teleop_control.nodes.recording.parameter_collector import (
    AT_THE_END,
    PATIENCE,
    ParameterCollector,
)
from haptic_teleop_control.nodes.timing.time_base import LATEST_QOS
from haptic_teleop_control.recording import read_recording


@cache
def compiled_while_running() -> tuple[dict[str, tuple[list[str], list[str]]], str]:
    """Node -> compiled functions before and after it ran; and what was said on standard error."""
    script = Path(__file__).parent / "compiled_while_running.py"
    done = subprocess.run(
        [sys.executable, str(script), *node_names()], capture_output=True, text=True, timeout=220, check=False
    )
    found = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("[")]
    return {name: (before, after) for name, before, after in found}, done.stderr


@pytest.mark.timeout(240)
@pytest.mark.parametrize("name", node_names())
def test_nothing_compiles_in_a_node_that_runs(name):
    """A compilation takes seconds: in the loop these are missing, and a robot has no command meanwhile."""
    results, errors = compiled_while_running()
    assert name in results, errors
    before, after = results[name]
    assert after == before


@contextmanager
def another(name: str) -> Iterator[Node]:
    """A node as in another process."""
    context = Context()
    context.init()
    node = Node(name, context=context)
    try:
        yield node
    finally:
        node.destroy_node()
        context.try_shutdown()


def test_a_publisher_is_unconnected_until_every_expected_subscription_has_met_it(graph):
    publisher = graph.probe.create_publisher(JointState, "/a", LATEST_QOS)
    here = endpoints([graph.probe])
    assert here[OUT]["/a"] == ["/probe"]
    expected = merged([here, {OUT: {}, IN: {"/a": ["/other"]}}])
    assert unconnected([graph.probe], expected) == ["/a"]
    with another("other") as other:
        expected = merged([expected, {PARTICIPANTS: endpoints([other])[PARTICIPANTS]}])
        # A subscription that is no counterpart: it asks for more than is offered.
        reliable = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
        other.create_subscription(JointState, "/a", print, reliable)
        graph.until(lambda: graph.probe.get_subscriptions_info_by_topic("/a"))
        assert publisher.get_subscription_count() == 0
        other.create_subscription(JointState, "/a", print, LATEST_QOS)
        graph.until(lambda: not unconnected([graph.probe], expected))
        assert publisher.get_subscription_count() == 1


def test_our_own_publishers_are_no_strangers_not_even_before_their_names_are_known(graph, monkeypatch):
    graph.probe.create_publisher(JointState, "/a", LATEST_QOS)
    ours = endpoints([graph.probe])
    seen = graph.until(lambda: graph.probe.get_publishers_info_by_topic("/a"))
    assert strangers(graph.probe, ours) == {}
    monkeypatch.setattr(type(graph.probe), "get_publishers_info_by_topic", lambda self, topic: seen)
    seen[0].node_name = "_NODE_NAME_UNKNOWN_"
    assert strangers(graph.probe, ours) == {}


@pytest.mark.parametrize("told", [True, False])
def test_by_names_alone_a_namesake_is_told_from_us_where_both_are_there(graph, told):
    graph.probe.create_publisher(JointState, "/a", LATEST_QOS)
    ours = endpoints([graph.probe])
    if not told:  # by a middleware whose ids do not say to which process an endpoint belongs
        ours[PARTICIPANTS] = {"": ["/probe"]}
    with another("probe") as node:
        node.create_publisher(JointState, "/a", LATEST_QOS)
        seen = graph.until(lambda: strangers(graph.probe, ours), what="the namesake")
        assert seen == {"/a": ["another /probe"]} or seen == {"/a": ["a node whose name is not known"]}
        graph.until(lambda: strangers(graph.probe, ours) == {"/a": ["another /probe"]})


def test_a_namesake_is_not_taken_for_one_of_ours_that_is_not_there_yet(graph):
    """Two runs of one file: a run that has discovered the other, but not yet all of itself."""
    expected = merged([endpoints([graph.probe]), {OUT: {"/a": ["/one"]}, IN: {"/b": ["/one"]}}])
    graph.probe.create_subscription(JointState, "/a", print, LATEST_QOS)
    graph.probe.create_publisher(JointState, "/b", LATEST_QOS)
    with another("one") as namesake:
        namesake.create_publisher(JointState, "/a", LATEST_QOS)
        namesake.create_subscription(JointState, "/b", print, LATEST_QOS)
        graph.until(lambda: strangers(graph.probe, expected) == {"/a": ["another /one"]})
        assert unconnected([graph.probe], expected) == ["/a", "/b"]
        with another("one") as ours:
            ours.create_publisher(JointState, "/a", LATEST_QOS)
            ours.create_subscription(JointState, "/b", print, LATEST_QOS)
            expected = merged([expected, {PARTICIPANTS: endpoints([ours])[PARTICIPANTS]}])
            graph.until(lambda: unconnected([graph.probe], expected) == [])
            assert strangers(graph.probe, expected) == {"/a": ["another /one"]}


@pytest.mark.parametrize("course", range(3))
def test_the_first_message_after_a_common_start_is_recorded_and_none_before(graph, tmp_path, course):
    """Several times, because discovery takes another course every time; each has to do."""
    publisher = graph.probe.create_publisher(JointState, "/sfj/joint_states", LATEST_QOS)
    options = {"output": tmp_path / "bag", "topics": "[/sfj/joint_states]"}
    given = [part for key, value in options.items() for part in ("-p", f"{key}:={value}")]
    recorder = Child("recorder", ["--ros-args", *given], armed=True)
    try:
        starter = Starter([recorder], graph.probe)

        def start() -> bool:
            if starter._expected is None:
                publisher.publish(JointState(name=["joint"], position=[-1.0]))
            recorder.relay()
            starter.poll()
            return starter.done

        graph.until(start, 30.0)
        for number in range(5):
            publisher.publish(JointState(name=["joint"], position=[float(number)]))
        graph.listen(0.2)
    finally:
        status = recorder.stop()
    assert (status, starter.missing) == (0, [])
    series = read_recording(tmp_path / "bag").topics["/sfj/joint_states"]
    assert series.position[:, 0].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]


def test_a_start_goes_on_after_a_while_and_names_what_is_missing(graph, tmp_path, monkeypatch):
    monkeypatch.setattr(starter_module, "CONNECT_LIMIT", 0.5)
    recorder = Child("recorder", ["--ros-args", "-p", f"output:={tmp_path / 'bag'}"], armed=True)
    try:
        # It publishes nothing on this topic with the reliability that the subscription asks for.
        reliable = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
        graph.probe.create_subscription(JointState, "/lonely", print, reliable)
        starter = Starter([recorder], graph.probe)
        starter._ready["somebody"] = {OUT: {"/lonely": ["/nowhere"]}, IN: {}}
        starter._children.insert(0, _Silent())

        def start() -> bool:
            recorder.relay()
            starter.poll()
            return starter.done

        graph.until(start, 30.0)
        assert "/lonely" in starter.missing
        assert "/lonely" in starter.warning
    finally:
        recorder.stop()


class _Silent:
    """A child that has said what it has and says no more."""

    name = "somebody"

    class link:
        @staticmethod
        def receive() -> list:
            return []

        @staticmethod
        def send(**content: object) -> None:
            pass


class _Clock:
    """Seconds that pass when the test says so."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def _answers_counted(monkeypatch, dropped: int) -> list[str]:
    """The answers that services send from now on, of which the first ``dropped`` of each do not arrive."""
    answers: list[str] = []
    send = Service.send_response

    def counted(service: Service, response: object, header: object) -> None:
        answers.append(service.srv_name)
        if answers.count(service.srv_name) > dropped:
            send(service, response, header)

    monkeypatch.setattr(Service, "send_response", counted)
    return answers


@pytest.fixture
def other(graph):
    """A node that answers, with one parameter."""
    node = Node("other", context=graph.context)
    node.declare_parameter("gain", 2.5)
    graph.executor.add_node(node)
    yield node
    graph.executor.remove_node(node)
    node.destroy_node()


def test_a_node_whose_answer_is_lost_is_asked_again_later_and_later(graph, other, monkeypatch):
    clock, answers = _Clock(), _answers_counted(monkeypatch, dropped=2)
    collector = ParameterCollector(graph.probe, clock)
    try:
        graph.until(lambda: collector.poll() or len(answers) == 1, 20.0)
        for moment, asked in ((0.9, 1), (1.1, 2), (3.0, 2), (3.2, 3)):  # of PATIENCE
            clock.now = moment * PATIENCE
            collector.poll()
            graph.until(lambda asked=asked: len(answers) >= asked, 20.0)
            graph.listen(0.1)
            assert len(answers) == asked
        clock.now += 100.0
        graph.until(lambda: collector.poll() or len(answers) == 4, 20.0)
        for _ in range(2):
            clock.now += 100.0
            collector.poll()
            graph.listen(0.1)
        graph.until(lambda: collector.poll() or "/other" in collector.parameters, 20.0)
        assert collector.parameters["/other"]["gain"] == 2.5
    finally:
        collector.close()


def test_an_answer_that_the_middleware_drops_is_asked_for_once_more_at_the_end_too(graph, other, monkeypatch):
    """On a busy machine the node has not met the client yet when it answers, and the answer is dropped: a
    recorder that was told to stop soon after gave up then, and the parameters were missing."""
    clock, answers = _Clock(), _answers_counted(monkeypatch, dropped=1)
    collector = ParameterCollector(graph.probe, clock)
    try:
        graph.until(lambda: collector.poll() or len(answers) == 1, 20.0)
        collector.ask_again()  # puts it again at once
        graph.until(lambda: collector.poll() or len(answers) == 3, 20.0)
        graph.listen(0.1)
        collector.poll()
        assert collector.waiting and "/other" not in collector.parameters
        clock.now += AT_THE_END + 1e-6
        graph.until(lambda: collector.poll() or not collector.waiting, 20.0)
        assert len(answers) == 4  # the names and the values, twice each
        assert collector.parameters["/other"]["gain"] == 2.5
    finally:
        collector.close()


def test_a_node_that_has_gone_is_not_waited_for(graph):
    silent = Node("silent", context=graph.context)  # in no executor, so it answers nothing
    collector = ParameterCollector(graph.probe)
    try:
        graph.until(lambda: collector.poll() or collector.silent == ["/silent"], 20.0)
        silent.destroy_node()
        graph.until(lambda: collector.poll() or not collector.waiting, 20.0)
        assert "/silent" not in collector.latest and not collector.silent
    finally:
        collector.close()


def test_at_the_end_no_client_is_destroyed_before_the_recording_is_closed(graph, other, monkeypatch):
    """What the middleware may hold up comes last: a recorder that did not end left a recording without its
    footer."""
    collector, destroyed = ParameterCollector(graph.probe), []
    try:
        graph.until(lambda: collector.poll() or "/other" in collector.parameters, 20.0)
        really = graph.probe.destroy_client
        monkeypatch.setattr(graph.probe, "destroy_client", lambda c: destroyed.append(c) or really(c))
        collector.ask_again()
        graph.until(lambda: collector.poll() or not collector.waiting, 20.0)
        assert collector.latest["/other"]["gain"] == 2.5
        assert not destroyed
    finally:
        collector.close()
    assert destroyed


def test_an_armed_executable_that_nobody_leads_refuses_in_one_sentence():
    command = [sys.executable, "-m", "haptic_teleop_control.front_door", "signal_generator", "--armed"]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=30)
    assert done.returncode == 2
    assert "leave it out" in done.stderr


def test_an_armed_process_ends_when_the_one_that_leads_it_has_gone():
    child = Child("signal_generator", [], armed=True)
    end = time.monotonic() + 30.0
    while not any("ready" in message for message in child.link.receive()):
        assert child.status is None and time.monotonic() < end
        time.sleep(0.02)
    child.link._socket.close()
    try:
        assert child.process.wait(10.0) == 0
    finally:
        if child.status is None:
            child.process.kill()


def test_a_process_says_that_it_compiles_when_it_does_and_only_then(monkeypatch, tmp_path):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    for told in (True, False):
        child = Child("signal_generator", [], armed=True)
        try:
            said, end = [], time.monotonic() + 90.0
            while not any("ready" in message for message in said):
                assert child.status is None and time.monotonic() < end
                said += child.link.receive()
                time.sleep(0.02)
        finally:
            child.stop()
        assert ({"compiling": True} in said) == told


def test_a_signal_ends_a_process_that_compiles_at_once():
    """With a cold cache the constructor of a plant takes some 20 s."""
    begun = time.monotonic()
    with stop_requests() as stop:
        threading.Timer(0.2, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
        with pytest.raises(StopRequests.Interrupt), stop.interruptible():
            time.sleep(20.0)
        assert stop.is_set()
    assert time.monotonic() - begun < 5.0


def test_a_signal_in_a_callback_that_drops_exceptions_ends_the_process_too_and_prints_nothing(capsys):
    """Met in the import of a module, which forgets its lock by such a callback."""

    class Lock:
        pass

    with stop_requests() as stop, pytest.raises(StopRequests.Interrupt), stop.interruptible():
        lock = Lock()
        forgets = weakref.ref(lock, lambda _: signal.raise_signal(signal.SIGINT))
        del lock
        assert forgets() is None and stop.is_set()
        time.sleep(20.0)  # the signal ends this; if it does not, the block ends without and the test fails
    assert capsys.readouterr().err == ""


def test_a_signal_inside_the_handler_of_another_does_not_hold_the_process():
    """The parent's end, its own front door and a user all send one: here a second one at every line of it."""
    asks = """
import signal, sys
from haptic_teleop_control.nodes.launching.stopping import stop_requests
def at_every_line(frame, event, argument):
    signal.raise_signal(signal.SIGTERM)
    return at_every_line
with stop_requests() as stop:
    sys.settrace(at_every_line)
    stop.take()
    sys.settrace(None)
    assert stop.is_set()
"""
    subprocess.run([sys.executable, "-c", asks], check=True, timeout=60)


class Run:
    """As others see it: `known` are the keys of the other runs."""

    def __init__(self) -> None:
        self.key, self.known = (2, "ours"), [(3, "later")]

    def others(self) -> list[tuple[int, str]]:
        return self.known


def test_of_two_runs_the_earlier_one_waits_until_all_of_the_later_one_has_left(graph, monkeypatch):
    seen = {"/command": ["/force_controller"]}
    now = 100.0
    monkeypatch.setattr(starter_module, "strangers", lambda *_: seen)
    monkeypatch.setattr(starter_module.time, "monotonic", lambda: now)
    run = Run()
    starter = Starter([], graph.probe, run=run)
    assert not starter._alone({})
    now, run.known = 110.0, []  # its node has gone, its controller has not
    assert not starter._alone({})
    seen = {}
    assert starter._alone({})
    seen, run.known = {"/command": ["/stray"]}, []
    assert not starter._alone({})
    now = 120.0
    with pytest.raises(ConfigurationError, match="is also published by /stray"):
        starter._alone({})
