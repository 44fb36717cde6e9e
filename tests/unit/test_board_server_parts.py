"""The board server's parts: datagrams, numbers, key, settings, its command, and what it needs to run at
all."""

import math
import re
import signal
import threading
from pathlib import Path

import numpy as np
import pytest
from board_wire import HERE, KEY
from device_rigs import SfjRig, StillRobot
from hypothesis import given
from hypothesis import strategies as st

from haptic_teleop_2dsfj.board import Board
from haptic_teleop_2dsfj.board_settings import BoardSettings
from haptic_teleop_2dsfj.build import all_faults, make_driver
from haptic_teleop_2dsfj.doctor_checks import board_checks
from haptic_teleop_2dsfj.driver import SfjDriver
from haptic_teleop_2dsfj.emulated_hil import EmulatedHil
from haptic_teleop_2dsfj.link_error import LinkError
from haptic_teleop_2dsfj.remote import datagrams as d
from haptic_teleop_2dsfj.remote import serve
from haptic_teleop_2dsfj.remote.board import RemoteBoard
from haptic_teleop_2dsfj.remote.key_file import default_key_file, make_key, read_key
from haptic_teleop_2dsfj.remote.link import UdpClient, UdpServer
from haptic_teleop_2dsfj.remote.round_trip import RoundTrips
from haptic_teleop_2dsfj.remote.sequence import Sequence
from haptic_teleop_2dsfj.remote.server import BoardServer
from haptic_teleop_2dsfj.remote.server_settings import ServerSettings
from haptic_teleop_2dsfj.remote.settings import RemoteSettings
from haptic_teleop_2dsfj.settings import TABLE as SFJ_TABLE
from haptic_teleop_2dsfj.settings import SfjDriverSettings
from haptic_teleop_control.clocks import SteadyClock, VirtualClock
from haptic_teleop_control.device import DeviceError, Reporter
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.health import BAD, OK
from haptic_teleop_control.parameter_files import load_parameter_file, parameters_for

INT64 = st.integers(-(2**63), 2**63 - 1)
UINT64, UINT32, BYTE = st.integers(0, 2**64 - 1), st.integers(0, 2**32 - 1), st.integers(0, 255)
NONCE, DOUBLE = st.binary(min_size=16, max_size=16), st.floats(allow_nan=False)
TEXT = st.text(st.characters(codec="ascii", min_codepoint=32), max_size=30)


def many(element, number):
    return st.tuples(*[element] * number)


DATAGRAMS = st.one_of(
    st.builds(d.Hello, NONCE, st.booleans()),
    st.builds(d.Probe, NONCE),
    st.builds(
        d.Welcome, NONCE, NONCE, st.booleans(), st.booleans(), DOUBLE, DOUBLE, BYTE, BYTE, DOUBLE, TEXT, TEXT
    ),
    st.builds(d.Start, NONCE),
    st.builds(
        d.State, UINT64, INT64, INT64, INT64, INT64, UINT64, UINT32, st.booleans(), BYTE,
        many(st.integers(-(2**31), 2**31 - 1), 4), many(DOUBLE, 2), many(st.integers(-128, 127), 4),
    ),
    st.builds(
        d.Command, UINT64, INT64, INT64, INT64, UINT32, st.booleans(), st.booleans(), DOUBLE, DOUBLE
    ),
    st.builds(d.Refusal, st.booleans(), TEXT),
)  # fmt: skip


@given(DATAGRAMS, st.data())
def test_a_datagram_arrives_as_it_was_and_none_that_was_touched_is_taken(datagram, draw):
    data = d.pack(datagram, KEY)
    assert d.unpack(data, KEY) == datagram
    place, bit = draw.draw(st.integers(0, len(data) - 1)), draw.draw(st.integers(0, 7))
    touched = bytes([*data[:place], data[place] ^ 1 << bit, *data[place + 1 :]])
    assert isinstance(d.unpack(touched, KEY), d.Trouble)
    assert isinstance(d.unpack(data[: draw.draw(st.integers(0, len(data) - 1))], KEY), d.Trouble)
    assert d.unpack(data, bytes(32)) is d.Trouble.KEY


def test_each_kind_has_one_size():
    sizes = {len(d.pack(d.Refusal(False, text), KEY)) for text in ("", "a" * 1000, "ö" * 500)}
    assert len(sizes) == 1 and max(sizes) < d.LARGEST


@given(st.lists(st.integers(1, 60), max_size=60))
def test_a_number_is_taken_once_and_only_if_none_after_it_was(numbers):
    sequence, taken = Sequence(), set()
    for number in numbers:
        expected = None if number > max(taken, default=0) else (
            d.Trouble.DUPLICATED if number in taken else d.Trouble.REORDERED
        )  # fmt: skip
        assert sequence.take(number) is expected
        if expected is None:
            taken.add(number)
    assert sequence.lost == max(taken, default=0) - len(taken)


def test_a_number_from_long_ago_is_refused_all_the_same():
    sequence = Sequence()
    assert sequence.take(10_000) is None
    assert sequence.take(3) is d.Trouble.DUPLICATED


def test_quantiles_of_round_trips_are_those_of_all_of_them_within_a_bin():
    seconds = np.random.default_rng(1).lognormal(math.log(3e-4), 1.0, 5000)
    trips = RoundTrips()
    for value in seconds:
        trips.add(float(value))
    for share in (0.5, 0.99, 0.999):
        among_all = np.quantile(seconds, share, method="inverted_cdf")
        assert trips.quantile(share) == pytest.approx(among_all, rel=0.05)
    assert trips.largest == seconds.max()
    assert str(RoundTrips()) == ""


# The key.


def test_the_key_is_made_once_for_its_user_alone_and_is_the_same_for_both_sides(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    with pytest.raises(ConfigurationError, match="copy the file that the server names"):
        read_key("")
    key = read_key("", make=True)
    assert read_key("") == read_key("", make=True) == key
    assert len(key) == 32
    assert default_key_file().stat().st_mode & 0o777 == 0o600
    with pytest.raises(ConfigurationError, match="no key can be made there"):
        make_key(default_key_file())


@pytest.mark.parametrize("content", ["", "00" * 31, "zz" * 32, "00" * 33, "\xff"])
def test_a_file_that_holds_no_key_is_named(tmp_path, content):
    file = tmp_path / "board.key"
    file.touch(0o600)
    file.write_text(content, encoding="latin-1")
    with pytest.raises(ConfigurationError, match=re.escape(str(file))):
        read_key(str(file))


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o660])
def test_a_key_that_others_may_read_or_write_is_none(tmp_path, mode):
    file = tmp_path / "board.key"
    make_key(file)
    file.chmod(mode)
    with pytest.raises(ConfigurationError, match="chmod 600"):
        read_key(str(file))


# Settings.


@pytest.mark.parametrize(
    ("stated", "words"),
    [
        ({"watchdog": 0.004}, "watchdog"),
        ({"watchdog": 0.3}, "watchdog"),
        ({"watchdog": 0.01, "rate": 100.0}, "less than two samples at 100 Hz"),
        ({"host": "192.168.10.2"}, "set host to an address in the network of the driver"),
        ({"peer": "192.168.10.3"}, "peer is 192.168.10.3"),
        ({"host": "0.0.0.0"}, "host is 0.0.0.0"),
        ({"host": "0.0.0.0", "peer": "0.0.0.0"}, "no single computer"),
        ({"host": "192.168.10.2", "peer": "255.255.255.255"}, "no single computer"),
        ({"host": "192.168.10.2", "peer": "224.0.0.1"}, "no single computer"),
        ({"host": "1.2.3"}, "no IPv4 address"),
        ({"answer_wait": 0.002}, "answer_wait is 0.002 s"),
        ({"highest_volts": [1.0]}, "highest_volts"),
        ({"board.type": 8}, "board.type"),
        ({"board.type": "remote"}, "name the board that is here"),
        ({"current_limit": 0.1}, "current_limit"),
    ],
)
def test_settings_that_would_be_dangerous_or_mean_nothing_are_refused(stated, words):
    with pytest.raises(ConfigurationError, match=words):
        ServerSettings.from_parameters(stated)


def test_a_named_peer_in_a_network_is_taken():
    ServerSettings.from_parameters({"host": "192.168.10.2", "peer": "192.168.10.3", "watchdog": 0.005})


def test_the_server_s_section_of_a_file_is_read_and_names_files_beside_it(tmp_path):
    file = tmp_path / "board.yaml"
    file.write_text(
        "sfj_board_server:\n  ros__parameters:\n    device: emulated\n    key: {file: own.key}\n"
        "    board: {watchdog: 0.03}\n"
    )
    values = serve.read_settings(str(file), ["port:=1234"])
    assert values["key.file"] == str(tmp_path / "own.key")
    assert (values["board.watchdog"], values["port"], values["device"]) == (0.03, 1234, "emulated")
    file.write_text("sfj_board_server:\n  ros__parameters: {device: emulated, board: q8_usb}\n")
    assert serve.read_settings(str(file), [])["board.type"] == "q8_usb"
    assert serve.read_settings(str(file), ["board.type:=q8"])["board.type"] == "q8"
    for other in (
        "sfj_driver:\n  ros__parameters: {rate: 500.0}\n",
        "/**:\n  ros__parameters: {device: emulated}\n",
    ):
        file.write_text(other)
        with pytest.raises(ConfigurationError, match="has no section sfj_board_server"):
            serve.read_settings(str(file), [])


def test_the_shipped_file_hands_out_an_emulated_board_on_this_computer_alone(repository):
    file = repository / "config" / "board_server.yaml"
    values = serve.read_settings(str(file), [])
    settings = ServerSettings.from_parameters(values)
    assert (values["device"], settings.host, settings.peer) == ("emulated", HERE, HERE)
    assert settings.watchdog == 0.02
    assert Path(values["emulated.file"]).is_file()


@pytest.mark.parametrize("step", ["hand", "move"])
def test_the_files_of_first_contact_begin_emulated_and_far_below_the_recommended_current(repository, step):
    sections = load_parameter_file(repository / "config" / f"first_contact_sfj_{step}.yaml")
    values = SFJ_TABLE.check(parameters_for(sections, "sfj_driver"))
    assert values["device"] == "emulated"
    assert values["stage1.current_limit"] == values["stage2.current_limit"] == 0.1
    levels = sections.get("acquisition", {}).get("signal.steps.levels", [0.0])
    assert max(map(abs, levels)) < 0.1 and levels[-1] == 0.0


@pytest.mark.parametrize("number", [1, 2])
def test_the_files_that_couple_the_robots_have_the_passivity_controller_on(repository, number):
    sections = load_parameter_file(repository / "config" / f"scenario{number}_real.yaml")
    assert parameters_for(sections, "force_controller")["passivity.controller"] is True


def test_a_remote_board_keeps_no_simulated_time(tmp_path):
    with pytest.raises(ConfigurationError, match="use_sim_time"):
        make_driver(
            {"device": "emulated", "board.type": "remote"}, Reporter.to_latch({})[0], clock=VirtualClock()
        )


# What a call costs.


@pytest.mark.parametrize(
    ("board", "options", "holds"),
    [("q8", "", True), ("q8_usb", "", False), ("q8_usb", "update_rate=fast", True)],
)
def test_a_loop_that_cannot_hold_500_hz_shows_in_the_samples_that_it_misses(board, options, holds):
    rig = SfjRig(board__type=board, board__options=options, board__watchdog=0.2)
    rig.run(300, (2.0, 0.4))
    assert rig.latch.latched is None
    assert rig.driver.missed == 0 if holds else 100 <= rig.driver.missed <= 200


def test_at_1_khz_even_the_fast_option_of_usb_has_little_left_and_pci_does_not_care():
    for board, late, holds in (("q8_usb", 6.5e-4, False), ("q8_usb", 6e-4, True), ("q8", 9e-4, True)):
        options = "update_rate=fast" if board == "q8_usb" else ""
        rig = SfjRig(rate=1000.0, board__type=board, board__options=options)
        for _ in range(200):
            rig.driver.read()
            rig.clock.advance(late)  # the controller thinks
            rig.driver.write(np.array([2.0, 0.4]))
        assert (rig.driver.missed == 0) is holds


def test_a_card_that_is_not_there_is_refused_by_its_name_as_by_the_sdk():
    with pytest.raises(DeviceError, match="no card of type remot; there are q8, q8_usb"):
        SfjRig(board__type="remot")


def test_an_option_that_the_card_does_not_know_is_its_refusal():
    with pytest.raises(Exception, match="set_card_specific_options"):
        SfjRig(board__type="q8_usb", board__options="update_rate=faster")


# Over real sockets.


def test_driver_and_server_over_udp_on_this_computer(tmp_path):
    settings = BoardSettings(watchdog=0.2)
    clock, robot = SteadyClock(), StillRobot()
    hil = EmulatedHil(robot, settings, clock)
    link = UdpServer(HERE, 0, clock)
    board, own = Board(settings, lambda: hil, clock=clock), ServerSettings(board=settings, watchdog=0.2)
    server = BoardServer(board, own, KEY, link.send, clock, emulated=True)
    server.open_board()
    stop = threading.Event()
    thread = threading.Thread(target=serve.serve, args=(server, link, clock, stop.is_set))
    thread.start()
    reporter, latch = Reporter.to_latch(all_faults())
    try:
        port = UdpClient(HERE, link.address[1], clock)
        remote = RemoteBoard(settings, RemoteSettings(silence=0.4), port, KEY, clock, emulated=True)
        driver = SfjDriver(SfjDriverSettings(board=settings, ramp_time=0.0), remote, reporter)
        driver.open()
        for _ in range(60):
            driver.read()
            driver.write(np.array([2.0, 0.4]))
        # Whether a stall of the machine was longer than the watchdog is not the question here.
        assert not latch.counts["board_link"] and not latch.counts["board_error"]
        assert any(any(given) for given in robot.given)
        assert remote.round_trips.count > 20
        driver.close()
    finally:
        stop.set()
        thread.join(5.0)
        link.close()
    assert not hil.volts.any() and not any(hil.amplifier_on) and not hil.opened


def test_where_nobody_listens_the_sentence_says_so_at_once():
    free = UdpServer(HERE, 0)
    port = free.address[1]
    free.close()
    remote = RemoteBoard(
        BoardSettings(), RemoteSettings(port=port), UdpClient(HERE, port), KEY, SteadyClock(), emulated=True
    )
    with pytest.raises(LinkError, match=f"nothing listens at {HERE}:{port}"):
        remote.open()


def test_doctor_asks_a_server_and_says_what_is_wrong_where_it_is_not_as_it_should_be(tmp_path):
    key, other = str(tmp_path / "board.key"), str(tmp_path / "other.key")
    make_key(Path(key))
    make_key(Path(other))
    settings, clock, link = BoardSettings(), SteadyClock(), UdpServer(HERE, 0)
    hil = EmulatedHil(StillRobot(), settings, clock)
    server = BoardServer(
        Board(settings, lambda: hil, clock=clock), ServerSettings(), read_key(key), link.send, clock, True
    )
    server.open_board()
    stop = threading.Event()
    thread = threading.Thread(target=serve.serve, args=(server, link, clock, stop.is_set))
    thread.start()
    address = f"{HERE}:{link.address[1]}"
    try:
        found = board_checks(address, key)
        assert found[0].level == OK
        assert "an emulated board q8 0 at 500 Hz, free; current to zero after 0.02 s" in found[0].finding
        assert "the keys differ" in board_checks(address, other)[0].finding
    finally:
        stop.set()
        thread.join(5.0)
        link.close()
    assert "nothing listens" in board_checks(address, key)[0].finding
    for wrong in ("", ":28765", f"{HERE}:", f"{HERE}:x", f"{HERE}:70000"):
        assert "is no address" in board_checks(wrong, key)[0].finding
    assert board_checks(address, str(tmp_path / "none.key"))[0].level == BAD


def test_two_servers_do_not_share_a_port():
    first = UdpServer(HERE, 0)
    with pytest.raises(ConfigurationError, match="end the other board server"):
        UdpServer(HERE, first.address[1])
    first.close()


# The command.

@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["-p", "peer:=192.168.1.5"], "peer is 192.168.1.5"),
        (["-p", "port=3"], "write name:=value"),
        (["-p", "watchdog:=0"], "watchdog is 0"),
        (["missing.yaml"], "missing.yaml"),
        ([], "quanser.hardware"),
    ],
)
def test_a_mistake_is_one_sentence_and_status_2(arguments, words, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    try:
        assert serve.main(arguments) == 2
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    assert words in capsys.readouterr().err.strip().splitlines()[-1]
