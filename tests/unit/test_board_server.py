"""A board in another computer: the same samples and currents as on a board here, and zero for everything
that may happen on the way."""

import math
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from board_wire import HERE, KEY, Wire
from device_rigs import SfjRig, StillRobot

from haptic_teleop_2dsfj.link_error import LinkError
from haptic_teleop_2dsfj.remote import datagrams as d
from haptic_teleop_control.device import ReadResult

PUSH = (2.0, 0.4)  # N·m
DT = 0.002
WATCHDOG = 0.02


class Turning(StillRobot):
    """A robot that turns steadily, whatever it is given."""

    def advance(self, current) -> None:
        super().advance(current)
        self.angles = 0.002 * len(self.given) * np.array([1.0, 1.1, -1.0, -0.9])


def test_what_the_driver_sees_and_what_flows_is_the_same_as_on_a_board_here():
    here, there = SfjRig(Turning()), Wire(Turning())
    there.driver.open()
    generator = np.random.default_rng(1)
    for _ in range(200):
        effort = generator.uniform(-4.0, 4.0, 2) * (generator.random() < 0.8)
        assert here.cycle(effort) is there.cycle(effort) is ReadResult.STATE
        assert np.array_equal(here.driver.velocity, there.driver.velocity)
        assert np.array_equal(here.driver.effort, there.driver.effort)
        assert np.allclose(here.driver.position, there.driver.position, rtol=0.0, atol=0.0)
        assert np.array_equal(here.hil.volts, there.hil.volts)
    assert here.plant.given[-199:] == there.plant.given[-199:]
    assert np.count_nonzero(here.plant.given[-199:]) > 250
    assert here.latch.latched is there.latch.latched is None
    assert there.driver.missed == 0


def test_angles_begin_at_zero_with_each_session_whatever_the_counters_hold():
    wire = Wire(Turning())
    for _ in range(50):
        wire.step()
    wire.drive()
    assert np.abs(wire.driver.position).max() < 0.05
    wire.driver.close()
    wire.driver.open()
    wire.cycle()
    assert np.abs(wire.driver.position).max() < 0.01


# Nothing is commanded, or nothing young.


@pytest.mark.parametrize("watchdog", [0.005, 0.02, 0.1])
def test_a_client_that_falls_silent_has_no_current_after_the_watchdog_and_a_sample(watchdog):
    wire = Wire(server={"watchdog": watchdog}).drive()
    begun, flowing = wire.clock.now(), 0
    while wire.clock.now() < begun + 0.3e9:
        wire.step()
        flowing += any(wire.hil.amplifier_on) and wire.hil.volts.any()
        if not wire.off:
            assert wire.clock.now() - begun <= (watchdog + DT) * 1e9
    assert wire.off
    assert watchdog - DT <= flowing * DT <= watchdog + DT
    assert f"no command for {watchdog:g} s" in wire.log[-1]


def test_a_stalled_driver_is_a_fault_at_zero_and_drives_again_after_a_reset():
    wire = Wire().drive()
    for _ in range(30):  # the driver does not run
        wire.step()
    assert wire.off
    wire.run(5, PUSH)
    assert wire.latch.latched == "watchdog_expired"
    assert "no command for 0.02 s" in wire.latch.sentence
    assert wire.off
    assert wire.drives_after_a_reset(PUSH)


def test_after_an_expiry_no_command_brings_current_back_until_it_is_asked_for_anew():
    wire = Wire().drive()
    for _ in range(30):
        wire.step()
    for _ in range(3):
        wire.remote.read()
        wire.remote.write(0.5, 0.5)  # a client that does not look at what it is told
        assert wire.off
    wire.remote.rearm_watchdog()
    wire.remote.enable(True)
    wire.remote.read()
    wire.remote.write(0.5, 0.5)
    assert not wire.off


def test_at_rest_a_session_lives_on_without_a_fault():
    wire = Wire()
    wire.driver.open()
    wire.run(1000)
    assert wire.server.session is not None
    assert wire.latch.latched is None
    assert wire.off


@pytest.mark.parametrize("delay", [0.011, 0.03, 0.2])
def test_a_way_that_is_too_slow_never_drives_and_is_a_fault(delay):
    wire = Wire(delay=delay, server={"watchdog": WATCHDOG})
    wire.remote._remote = wire.remote._remote.__class__(silence=0.4)
    wire.driver.open()
    wire.run(300, PUSH)
    assert wire.latch.latched == "watchdog_expired"
    assert "the link is too slow" in wire.latch.sentence
    assert not np.any(wire.plant.given), "not for a sample"
    assert wire.off


def test_a_delay_that_begins_while_it_drives_ends_in_zero_before_the_first_late_command():
    wire = Wire().drive()
    wire.delay = round(0.03e9)
    passed = len(wire.plant.given)
    wire.run(40, PUSH)
    flowing = sum(any(given) for given in wire.plant.given[passed:]) * DT
    assert flowing <= WATCHDOG + 2 * DT
    assert wire.latch.latched == "watchdog_expired"
    assert wire.off


def test_a_delay_within_the_watchdog_drives():
    wire = Wire(delay=0.003).drive()
    wire.run(200, PUSH)
    assert wire.latch.latched is None
    assert not wire.off


# What must not happen on the way.


def held(wire: Wire):
    """Lets the next datagram be overtaken by the one after it."""
    kept: list[bytes] = []

    def pass_on(data: bytes) -> list[bytes]:
        if not kept:
            kept.append(data)
            return []
        return [data, kept[0]] if len(kept) == 1 and not kept.append(b"") else [data]

    return pass_on


def once(change):
    """`change` for the next datagram, and no other."""
    done: list[bool] = []

    def pass_on(data: bytes) -> list[bytes]:
        if done:
            return [data]
        done.append(True)
        return change(data)

    return pass_on


def flip(data: bytes) -> bytes:
    return bytes([*data[:20], data[20] ^ 1, *data[21:]])


HAPPENS = {
    "duplicated": (lambda wire: once(lambda data: [data, data]), "duplicated or replayed"),
    "reordered": (held, "overtaken"),
    "too long": (lambda wire: once(lambda data: [data + b"\0"]), "wrong length"),
    "too short": (lambda wire: once(lambda data: [data[:-1]]), "wrong length"),
    "empty": (lambda wire: once(lambda data: [b""]), "wrong length"),
    "changed": (lambda wire: once(lambda data: [flip(data)]), "not signed with the key"),
    "foreign": (lambda wire: once(lambda data: [b"M-SEARCH * HTTP/1.1\r\n", data]), "none of this protocol"),
}  # fmt: skip


@pytest.mark.parametrize("direction", ["up", "down"])
@pytest.mark.parametrize("what", HAPPENS)
def test_what_is_wrong_with_one_datagram_ends_in_zero_and_a_fault_that_says_it(what, direction):
    wire = Wire().drive()
    hazard, words = HAPPENS[what]
    setattr(wire, direction, hazard(wire))
    wire.run(4, PUSH)
    assert wire.latch.latched == "board_link"
    assert words in wire.latch.sentence
    assert wire.off
    assert wire.server.session is None
    wire.up = wire.down = lambda data: [data]
    assert wire.cycle(PUSH) is ReadResult.LOST
    assert wire.off
    assert wire.drives_after_a_reset(PUSH)


def test_a_datagram_that_gets_lost_now_and_then_is_counted_and_nothing_else():
    wire = Wire().drive()
    generator = np.random.default_rng(2)
    wire.up = wire.down = lambda data: [data] if generator.random() < 0.9 else []
    wire.run(200, PUSH)
    assert wire.latch.latched is None
    assert not wire.off
    assert wire.driver.missed == int(wire.remote.measurements()["datagrams lost"]) > 5
    assert wire.server.session.incoming.lost > 5


@pytest.mark.parametrize("old", range(3))
def test_a_datagram_of_an_earlier_session_ends_in_zero(old):
    wire = Wire().drive()
    recorded = [data for data in wire.sent if d.kind_of(data) is d.Command][old]
    wire.driver.close()
    wire.driver.open()
    wire.run(5, PUSH)
    assert not wire.off
    wire.to_server(recorded)
    assert wire.off
    wire.cycle(PUSH)
    assert wire.latch.latched == "board_link"


def test_a_whole_session_replayed_to_an_idle_server_moves_nothing():
    wire = Wire().drive()
    recorded = list(wire.sent)
    wire.driver.close()
    given = len(wire.plant.given)
    for data in recorded:
        wire.to_server(data)
        wire.step()
        assert wire.server.session is None
        assert wire.off
    assert not np.any(wire.plant.given[given:])


def test_a_server_replayed_to_a_client_is_not_believed():
    wire = Wire().drive()
    recorded = list(wire.told)
    wire.driver.close()
    wire.up = lambda data: []
    port = wire.ports[40_000]
    port.open = lambda: port.inbox.extend((0, data) for data in recorded)
    with pytest.raises(LinkError, match="somebody else's question"):
        wire.driver.open()


def test_a_second_client_is_refused_and_the_first_one_stops():
    wire = Wire().drive()
    second = wire.client(40_001)
    with pytest.raises(LinkError, match=f"another client, {HERE}:40000, drives the board"):
        second.open()
    assert wire.off
    wire.run(2, PUSH)
    assert wire.latch.latched == "board_link"
    assert "second client" in wire.latch.sentence


def test_a_client_with_another_key_hears_that_and_stops_the_one_that_drives():
    wire = Wire().drive()
    second = wire.client(40_001, bytes(32))
    with pytest.raises(LinkError, match="the keys differ"):
        second.open()
    assert wire.off
    wire.run(2, PUSH)
    assert wire.latch.latched == "board_link"
    with pytest.raises(LinkError, match="the keys differ"):
        second.open()


def test_another_computer_is_not_heard_at_all():
    wire = Wire().drive()
    for data in (wire.sent[0], wire.sent[-1], b"", b"x" * 2000):
        wire.to_server(data, ("192.168.1.77", 40_000))
    wire.run(5, PUSH)
    assert wire.server.strangers == 4
    assert wire.latch.latched is None
    assert not wire.off


@pytest.mark.parametrize("volts", [(math.nan, 0.0), (0.0, math.inf), (1.9, 0.0), (0.0, -2.5)])
def test_a_command_that_no_driver_gives_ends_in_zero(volts):
    wire = Wire().drive()
    wire.driver.read()
    wire.remote.write(*volts)
    assert wire.off
    wire.cycle(PUSH)
    assert wire.latch.latched == "board_link"
    assert "highest_volts" in wire.latch.sentence


def test_a_command_that_answers_a_sample_of_the_future_ends_in_zero():
    wire = Wire().drive()
    wire.remote._stamp += 10**9
    wire.remote.write(0.1, 0.1)
    assert wire.off


# Cables.


@pytest.mark.parametrize("direction", ["up", "down", "both"])
def test_a_network_cable_that_is_pulled_is_zero_after_the_watchdog_and_a_fault(direction):
    wire = Wire().drive()
    cut = lambda data: []  # noqa: E731
    if direction != "down":
        wire.up = cut
    if direction != "up":
        wire.down = cut
    passed = len(wire.plant.given)
    while wire.latch.latched is None:
        wire.cycle(PUSH)
    wire.run(600, PUSH)
    for _ in range(600):  # until the server, too, has noticed
        wire.step()
    flowing = sum(any(given) for given in wire.plant.given[passed:]) * DT
    assert flowing <= WATCHDOG + 2 * DT
    assert wire.off
    assert wire.latch.latched == ("watchdog_expired" if direction == "up" else "board_link")
    wire.up = wire.down = lambda data: [data]
    assert wire.drives_after_a_reset(PUSH)


def test_a_board_that_is_unplugged_from_its_server_is_a_fault_with_its_words_and_comes_back():
    wire = Wire().drive()
    wire.hil.unplug()
    wire.run(2, PUSH)
    assert wire.latch.latched == "board_link"
    assert "the board does not respond" in wire.latch.sentence
    wire.reset()
    assert "cannot be opened" in wire.latch.sentence, "still unplugged"
    wire.hil.plug()
    assert wire.drives_after_a_reset(PUSH)


def test_a_server_that_stalls_meets_the_board_s_own_watchdog_and_the_driver_hears_it():
    wire = Wire().drive()
    wire.clock.advance(0.05)
    wire.run(3, PUSH)
    assert wire.latch.latched == "watchdog_expired"
    assert "the board server stalled" in wire.latch.sentence
    assert wire.off
    wire.reset()
    wire.run(5, PUSH)
    assert not wire.off


def test_a_server_that_stalls_between_a_sample_and_its_answer_finds_the_board_at_zero_and_not_lost():
    wire = Wire(server={"watchdog": 0.1}).drive()
    wire.driver.read()
    wire.clock.advance(0.03)  # more than the board's watchdog, and the answer is young all the same
    wire.driver.write(np.array(PUSH))
    wire.run(2, PUSH)
    assert wire.latch.latched == "watchdog_expired"
    assert "the board server stalled" in wire.latch.sentence
    assert wire.off and wire.hil.opened


def test_a_server_that_ends_says_so_and_leaves_zero():
    wire = Wire().drive()
    wire.server.close()
    assert wire.off
    assert not wire.hil.opened
    wire.cycle(PUSH)
    assert "the board server has ended" in wire.latch.sentence


def test_a_driver_that_ends_leaves_zero_and_the_board_to_the_next_one():
    wire = Wire().drive()
    wire.driver.close()
    assert wire.off
    assert "client has left" in wire.log[-1]
    other = wire.client(40_001)
    other.open()
    assert wire.server.session is not None


# Who may begin.


def test_a_driver_for_emulated_devices_does_not_begin_on_a_real_board_nor_the_reverse():
    wire = Wire()
    with pytest.raises(LinkError, match="has an emulated board, and the driver's device is hardware"):
        wire.client(40_001, emulated=False).open()
    wire.server.reception.emulated = False
    with pytest.raises(LinkError, match="has a real board, and the driver's device is emulated"):
        wire.driver.open()


@pytest.mark.parametrize(
    ("key", "change"),
    [
        ("rate", {"rate": 250.0}),
        ("board.counter_bits", {"counter_bits": 32}),
        ("board.range", {"range_volts": 5.0}),
    ],
)
def test_settings_that_differ_are_named(key, change):
    wire = Wire()
    wire.settings = SimpleNamespace(board=replace(wire.settings.board, **change))
    with pytest.raises(LinkError, match=rf"{re.escape(key)} is \d+ there and \d+ here; state it alike"):
        wire.client(40_001).open()


def test_a_server_that_does_not_answer_is_named_after_a_while():
    wire = Wire()
    wire.up = lambda data: []
    with pytest.raises(LinkError, match=rf"{HERE}:28765: no answer for 3 s; check that it runs"):
        wire.driver.open()


def test_greetings_that_are_repeated_or_lost_begin_one_session():
    wire = Wire(delay=0.4)
    wire.driver.open()
    wire.delay = 0
    for _ in range(5):
        wire.step()
    assert wire.server.session is not None
    losing = Wire()
    generator = np.random.default_rng(3)
    losing.up = losing.down = lambda data: [data] if generator.random() < 0.5 else []
    losing.driver.open()
    assert losing.server.session is not None


def test_a_probe_disturbs_nobody():
    wire = Wire().drive()
    wire.ports[40_001] = type(wire.ports[40_000])(wire, 40_001)
    wire.to_server(d.pack(d.Probe(bytes(16)), KEY), (HERE, 40_001))
    answer = d.unpack(wire.told[-1], KEY)
    assert isinstance(answer, d.Welcome) and answer.busy
    wire.run(5, PUSH)
    assert wire.latch.latched is None
    assert not wire.off
