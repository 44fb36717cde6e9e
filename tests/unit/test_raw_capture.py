"""Captured sessions: replayed byte for byte whatever happened in them, and read as far as they are whole."""

import random

import numpy as np
import pytest
from device_rigs import StillOmni, StillRobot

from haptic_teleop_2dsfj.board import Board
from haptic_teleop_2dsfj.build import all_faults
from haptic_teleop_2dsfj.build import replay_capture as replay_sfj
from haptic_teleop_2dsfj.driver import SfjDriver
from haptic_teleop_2dsfj.emulated_hil import EmulatedHil
from haptic_teleop_2dsfj.settings import SfjDriverSettings
from haptic_teleop_control.clocks import VirtualClock
from haptic_teleop_control.device import ReadResult, Reporter
from haptic_teleop_control.errors import RecordingError
from haptic_teleop_control.raw_capture import COMMAND, READ, RESET, WRITE, RawCapture, read_capture
from haptic_teleop_omni.build import ALL_FAULTS
from haptic_teleop_omni.build import replay_capture as replay_omni
from haptic_teleop_omni.driver import OmniDriver
from haptic_teleop_omni.layout import load_layout
from haptic_teleop_omni.settings import OmniDriverSettings
from haptic_teleop_omni.transports.emulated import EmulatedOmni


class Recorded:
    """A session as the driver's node runs it: what it gives the driver, and the states that it publishes."""

    def __init__(self, robot: str, path) -> None:
        self.robot, self.clock = robot, VirtualClock()
        stated = (
            {"stage1.drift_correction": 0.05, "board.watchdog": 0.05}
            if robot == "sfj"
            else {"calibration.method": "start", "calibration.angles": [0.1, -0.2, 0.3]}
        )
        self.capture = RawCapture(path, robot, {**stated, "device": "emulated"})
        self.states: list[tuple[int, bytes]] = []
        self.cycles = 0
        if robot == "sfj":
            settings = SfjDriverSettings.from_parameters(stated)
            self.plant = StillRobot()
            self.device = EmulatedHil(self.plant, settings.board, self.clock)
            reporter, self.latch = Reporter.to_latch(all_faults())
            taps = self._tap(READ), self._tap(WRITE)
            board = Board(settings.board, lambda: self.device, *taps, clock=self.clock)
            self.driver = SfjDriver(settings, board, reporter)
        else:
            layout = load_layout("emulator")
            self.plant = StillOmni()
            self.device = EmulatedOmni(self.plant, layout, self.clock, 1000.0, 0.0)
            reporter, self.latch = Reporter.to_latch(ALL_FAULTS)
            settings = OmniDriverSettings.from_parameters(stated)
            self.driver = OmniDriver(settings, layout, self.device, reporter, self._add)
        self.driver.open()

    def _add(self, channel: str, data: bytes) -> None:
        self.capture.add(channel, self.clock.now(), data)

    def _tap(self, channel: str):
        return lambda data: self._add(channel, data)

    def run(self, samples: int, effort=None) -> None:
        for _ in range(samples):
            self.cycles += 1
            self.plant.angles[:] = 0.1 * np.sin(0.01 * self.cycles)
            result = self.driver.read()
            if result is ReadResult.LOST:
                continue
            if result is ReadResult.STATE:
                state = np.concatenate([self.driver.position, self.driver.velocity, self.driver.effort])
                self.states.append((self.cycles, state.tobytes()))
            drive = result is ReadResult.STATE and effort is not None and self.latch.latched is None
            command = np.array(effort) if drive else None
            data = b"" if command is None else command.astype("<f8").tobytes()
            self.capture.add(COMMAND, self.cycles, data)
            self.driver.write(command)

    def reset(self, reopened: bool = False) -> None:
        self.latch.reset()
        self._add(RESET, bytes([reopened]))
        if reopened:
            self.driver.close()
        self.driver.reset()

    def close(self) -> None:
        self.driver.close()
        self.capture.close()


def eventful_session(robot: str, path) -> Recorded:
    """Driven, stalled, refused, unplugged, opened again."""
    session = Recorded(robot, path)
    push = [2.0, 0.4] if robot == "sfj" else [0.05, -0.3, 0.1]
    session.run(50)
    session.run(200, push)
    session.clock.advance(0.2)
    session.run(20, push)
    session.reset()
    if robot == "sfj":
        session.device.stuck[3] = 0
        session.run(20, push)
        session.device.stuck.clear()
    else:
        session.device.drop = 3
        session.device.corrupt = 4
        session.run(20, push)
    session.reset()
    session.run(40, push)
    session.device.unplug()
    session.run(5, push)
    session.device.plug()
    session.reset(reopened=True)
    session.run(100, push)
    session.close()
    return session


REPLAY = {"sfj": replay_sfj, "omni": replay_omni}


def replayed(robot: str, path) -> list[tuple[int, bytes]]:
    capture = read_capture(path, robot)
    states = REPLAY[robot](capture, capture.parameters)
    rows = np.concatenate([states.position, states.velocity, states.effort], axis=1)
    return [(int(stamp), row.tobytes()) for stamp, row in zip(states.stamp, rows, strict=True)]


def test_a_session_in_which_samples_lost_step_with_the_clock_replays_to_the_same_fault(tmp_path):
    session = Recorded("sfj", tmp_path / "session.mcap")
    session.run(400, [2.0, 0.4])
    session.device.lose(2)
    session.run(400, [2.0, 0.4])
    session.close()
    assert session.latch.latched == "sample_clock"
    assert replayed("sfj", tmp_path / "session.mcap") == session.states
    capture = read_capture(tmp_path / "session.mcap", "sfj")
    assert replay_sfj(capture, capture.parameters).faults["sample_clock"] == 1


@pytest.mark.parametrize("robot", REPLAY)
def test_a_session_with_stalls_faults_and_a_lost_device_replays_byte_for_byte(robot, tmp_path):
    path = tmp_path / "session.mcap"
    session = eventful_session(robot, path)
    faults = {name for name, count in session.latch.counts.items() if count}
    assert len(faults) >= 2, faults
    assert len(session.states) > 380
    again = replayed(robot, path)
    assert again == session.states


@pytest.mark.parametrize("robot", REPLAY)
def test_a_capture_that_was_cut_anywhere_replays_the_beginning_of_its_states(robot, tmp_path):
    path = tmp_path / "session.mcap"
    session = eventful_session(robot, path)
    whole = path.read_bytes()
    cut = tmp_path / "cut.mcap"
    lengths = set()
    for share in (0.999, 0.9, 0.6, 0.3):
        cut.write_bytes(whole[: int(share * len(whole))])
        capture = read_capture(cut, robot)
        assert not capture.complete
        states = replayed(robot, cut)
        # The last one may have lost its command, and with it its stamp.
        assert [state for _, state in states] == [state for _, state in session.states[: len(states)]]
        lengths.add(len(states))
    assert max(lengths) > 100


def test_a_damaged_capture_is_read_as_far_as_it_is_whole_or_refused_in_one_sentence(tmp_path):
    path, damaged = tmp_path / "session.mcap", tmp_path / "damaged.mcap"
    eventful_session("omni", path)
    whole = path.read_bytes()
    packets = read_capture(path, "omni").packets
    chance = random.Random(7)
    outcomes = set()
    for number in range(120):
        data = bytearray(whole)
        place = chance.randrange(1500 if number % 2 else len(data))
        data[place] ^= 1 << chance.randrange(8)
        damaged.write_bytes(data)
        try:
            capture = read_capture(damaged, "omni")
        except RecordingError as refusal:
            assert "damaged.mcap" in str(refusal)
            outcomes.add("refused")
            continue
        outcomes.add("whole" if capture.complete else "beginning")
        assert capture.packets == packets[: len(capture.packets)]
    assert outcomes >= {"refused", "beginning"}


def test_a_full_disk_ends_the_capture_and_not_the_driver(tmp_path):
    capture = RawCapture(tmp_path / "session.mcap", "sfj", {})

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    capture._writer.add_message = full
    for stamp in range(50):
        capture.add(READ, stamp, b"sample")
    capture.close()
    assert capture.failure is not None
    capture.add(READ, 51, b"sample")
    capture.close()


def test_an_existing_file_is_not_overwritten(tmp_path):
    path = tmp_path / "session.mcap"
    path.write_bytes(b"a day's work")
    with pytest.raises(RecordingError, match=r"session\.mcap.*name a new file"):
        RawCapture(path, "sfj", {})
    assert path.read_bytes() == b"a day's work"
