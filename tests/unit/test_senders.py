"""Who may send on a stream: one, and its successor; two at once are noticed and named."""

import pytest

from haptic_teleop_control.senders import LOOK_AGAIN, NAMELESS, SenderGuard

A, B = b"aaaa", b"bbbb"
SILENCE = 100
NAMES = {A: "/force_controller", B: "/intruder"}


class Stream:
    """A receiver as it uses its guard: at one sample every ns."""

    def __init__(self, listed: dict[bytes, str] | None = None) -> None:
        self.listed = dict(NAMES) if listed is None else listed
        self.looks = 0
        self.reports: list[str] = []
        self.guard = SenderGuard(SILENCE, self._look, self.reports.append)
        self.now = LOOK_AGAIN

    def _look(self) -> dict[bytes, str]:
        self.looks += 1
        return self.listed

    def send(self, sender: bytes, after: int = 1) -> bool:
        self.now += after
        if sender == self.guard.sole:
            self.guard.heard = self.now
            return True
        return self.guard.admit(sender, self.now)


def test_one_sender_is_admitted_without_a_look_at_the_graph():
    stream = Stream()
    assert all(stream.send(A) for _ in range(1000))
    assert (stream.looks, stream.reports, stream.guard.refused) == (0, [], 0)


def test_two_senders_are_named_at_the_first_turn_and_only_the_first_is_admitted():
    stream = Stream()
    taken = [stream.send(sender) for sender in (A, A, B, A, B, B, A)]
    assert taken == [True, True, False, True, False, False, True]
    assert stream.reports == ["/force_controller and /intruder"] * 2
    assert stream.guard.refused == 3


def test_two_busy_senders_cost_no_look_at_the_graph_for_each_sample():
    stream = Stream()
    for _ in range(500):
        stream.send(A), stream.send(B)
    assert stream.looks <= 3


def test_a_successor_of_a_sender_that_fell_silent_is_admitted_without_a_report():
    stream = Stream()
    stream.send(A)
    assert not stream.send(B)
    assert stream.send(B, after=SILENCE)
    assert all(stream.send(B) for _ in range(10))
    assert stream.reports == []


def test_a_successor_is_admitted_at_once_when_the_graph_lists_the_first_no_more():
    stream = Stream({B: "/force_controller"})
    stream.send(A)
    assert stream.send(B)
    assert stream.send(B)
    assert stream.reports == []


@pytest.mark.parametrize("listed", [{}, {A: "/a"}])
def test_a_graph_that_does_not_know_the_newcomer_yet_proves_nothing(listed):
    stream = Stream(listed)
    stream.send(A)
    assert not stream.send(B)


def test_a_sender_that_was_stopped_and_goes_on_after_its_successor_came_is_noticed():
    stream = Stream()
    stream.send(A)
    assert stream.send(B, after=2 * SILENCE)
    assert not stream.send(A)
    assert stream.reports == ["/intruder and /force_controller"]


def test_two_senders_slower_than_the_silence_are_noticed():
    stream = Stream()
    for sender in (A, B, A):
        assert stream.send(sender, after=2 * SILENCE)
    assert len(stream.reports) == 1


def test_the_one_that_is_left_is_admitted_again_and_then_silent_about_it():
    """The operator ends B; or ends A, and B is the one."""
    for left in (A, B):
        stream = Stream()
        for sender in (A, B, A, B):
            stream.send(sender)
        stream.send(left, after=2 * SILENCE)
        stream.reports.clear()
        assert all(stream.send(left) for _ in range(10))
        assert stream.reports == []


def test_two_nodes_of_one_name_are_told_apart_and_one_without_a_name_is_said_to_have_none():
    same = Stream({A: "/force_controller", B: "/force_controller"})
    unknown = Stream({A: "/force_controller"})
    for stream in (same, unknown):
        for sender in (A, B, A):
            stream.send(sender)
    assert "another of this name" in same.reports[0] and B.hex() in same.reports[0]
    assert unknown.reports[0] == f"/force_controller and {NAMELESS}"
    unknown.listed[B] = "/intruder"
    unknown.send(B)
    unknown.send(A, after=LOOK_AGAIN)
    assert unknown.reports[1] == "/force_controller and /intruder", "the graph learns a name later"


def test_what_was_heard_before_a_reset_is_no_turn_after_it():
    stream = Stream()
    for sender in (A, B, A, B):
        stream.send(sender)
    stream.reports.clear()
    stream.guard.forget()
    assert stream.send(A)
    assert stream.reports == []
    assert not stream.send(B)
    assert stream.send(A)
    assert len(stream.reports) == 1
