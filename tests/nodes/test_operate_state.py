"""`operate state` tells the last of several kept states, whatever else is heard meanwhile."""

from types import SimpleNamespace

from haptic_teleop_control.nodes import operator_client


def test_the_last_state_is_told_though_another_message_comes_before_it():
    heard, comes = {}, [lambda: None, lambda: heard["/c/state"](SimpleNamespace(data="fault"))]

    def subscribe(kind, topic, take, quality):
        heard[topic] = take

    def until(done, wait, called):
        if "/diagnostics" not in heard:
            heard["/c/state"](SimpleNamespace(data="engaged"))
        return done()

    client = SimpleNamespace(
        node=SimpleNamespace(create_subscription=subscribe),
        until=until,
        executor=SimpleNamespace(spin_once=lambda timeout_sec: comes.pop(0)() if comes else None),
    )
    assert operator_client._state(client, "/c", 1.0) == "fault"
