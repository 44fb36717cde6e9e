"""`operate state` tells the last of several kept states, whatever else is heard, however long it takes."""

import time
from types import SimpleNamespace

from haptic_teleop_control.nodes import operator_client
from haptic_teleop_control.nodes.graph_client import GraphClient


def test_the_last_state_is_told_though_another_message_comes_before_it(monkeypatch):
    now, heard = [0.0], {}
    comes = [lambda: None, lambda: heard["/c/state"](SimpleNamespace(data="fault"))]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])

    def spin_once(timeout_sec):
        now[0] += 60.0  # the machine stands still
        if comes:
            comes.pop(0)()

    class Client(GraphClient):
        def __init__(self):
            self.node = SimpleNamespace(create_subscription=self.subscribe)
            self.executor = SimpleNamespace(spin_once=spin_once)

        def subscribe(self, kind, topic, take, quality):
            heard[topic] = take
            if topic == "/c/state":
                take(SimpleNamespace(data="engaged"))

    assert operator_client._state(Client(), "/c", 1.0) == "fault"
