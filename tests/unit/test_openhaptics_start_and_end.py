"""The Omni through the vendor's HD library: how it begins, and that nothing is left behind at its end."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from openhaptics_rig import NEUTRAL, Emulation, HdRig, compile_library

from haptic_teleop_control.device import DeviceError, ReadResult
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.raw_capture import RawCapture, read_capture
from haptic_teleop_control.replay import Session
from haptic_teleop_omni.build import make_driver, replay_capture
from haptic_teleop_omni.transports import hd_frame, openhaptics
from haptic_teleop_omni.transports.hd_library import SIGNATURES, load_library

PUSH = (0.02, 0.1, -0.05)  # N·m
COUNT = 4.1e-4  # rad, of the emulated device's encoders


def first_frames(em) -> None:
    """The scheduler has started anew, and its first frames are errors."""
    for _ in range(8):
        em.c.em_tick()


@pytest.fixture
def rig(em, tmp_path):
    rig = HdRig(em, tmp_path)
    rig.settle()
    yield rig
    rig.driver.close()


# The start.


@pytest.fixture
def calls(em, monkeypatch):
    """Names of the library's calls that this side makes, in their order."""
    library, made = load_library(str(em.path)), []
    for name in SIGNATURES:
        call = getattr(library.library, name)
        spy = lambda *given, name=name, call=call: (made.append(name), call(*given))[1]  # noqa: E731
        monkeypatch.setattr(library, name, spy, raising=False)
    return made


def test_the_force_is_off_before_the_library_is_asked_anything_of_a_device(em, tmp_path, calls):
    em.c.em_left_on(0)
    rig = HdRig(em, tmp_path, confirmed=False)
    assert em.off(), "no frame has done it: it knows of no force"
    asked = [name for name in calls[calls.index("hdInitDevice") + 1 :] if name != "hdGetError"]
    assert asked[:2] == ["hdMakeCurrentDevice", "hdDisable"]
    rig.driver.close()


def test_a_wrong_name_is_answered_with_the_parameter_that_sets_it(em, tmp_path):
    with pytest.raises(DeviceError, match=r"'Nobody'.*0x0303.*openhaptics\.device_name"):
        HdRig(em, tmp_path, confirmed=False, openhaptics__device_name="Nobody")
    assert em.c.em_running() == 0


def test_both_default_names_are_tried_because_generations_differ(em, tmp_path):
    em.c.em_rename(0, b"Default PHANToM")
    rig = HdRig(em, tmp_path)
    rig.settle()
    rig.driver.close()


@pytest.mark.parametrize(
    ("code", "word"), [(0x0600, "licence"), (0x0302, "/dev/fw"), (0x0301, "another program")]
)
def test_a_device_that_cannot_be_opened_says_what_helps(em, tmp_path, code, word):
    em.c.em_refuse(code)
    with pytest.raises(DeviceError, match=word):
        HdRig(em, tmp_path, confirmed=False)


def test_a_library_that_lacks_a_symbol_is_refused_by_that_symbol(tmp_path):
    path = compile_library(tmp_path, "libHD_old.so", "-DWITHOUT_ASYNCHRONOUS")
    with pytest.raises(ConfigurationError, match=r"no hdScheduleAsynchronous.*openhaptics\.library"):
        load_library(str(path))


@pytest.mark.parametrize("stated", ["/nowhere/libHD.so", "libHD_of_nobody.so"])
def test_a_library_that_is_not_there_is_one_sentence_with_the_remedy(stated):
    with pytest.raises(ConfigurationError, match=r"cannot be loaded.*install.*openhaptics\.library"):
        load_library(stated)


def test_a_library_by_a_relative_path_is_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigurationError, match="absolute path"):
        load_library("./libHD.so")


@pytest.mark.parametrize(("change", "word"), [({"rate": 500.0}, "rate"), ({"layout": "touch_hid"}, "layout")])
def test_what_the_library_cannot_do_is_refused_by_parameter(em, change, word):
    values = {"device": "hardware", "transport": "openhaptics", "openhaptics.library": str(em.path), **change}
    with pytest.raises(ConfigurationError, match=f"{word} is"):
        make_driver(values, None)


def test_another_serial_number_than_the_stated_one_is_refused_and_its_device_released(em, tmp_path):
    with pytest.raises(ConfigurationError, match=r"EM0002.*EM0001"):
        HdRig(em, tmp_path, confirmed=False, openhaptics__serial="EM0002")
    assert not em.c.em_is_open(0)


def test_two_devices_in_one_process_keep_their_angles_torques_and_ends_apart(em, tmp_path, monkeypatch):
    em.place(NEUTRAL - 0.1, 1)
    one = HdRig(em, tmp_path)
    one.settle()
    one.run(3, (0.05,) * 3)
    assert em.torque(0) == pytest.approx([0.05] * 3, abs=1e-6)
    opened = openhaptics.OpenHapticsTransport._init_device
    unattended = []

    def slow(transport):
        unattended.append(not em.off(0))  # the servo thread stands still, which holds the last torque
        return opened(transport)

    monkeypatch.setattr(openhaptics.OpenHapticsTransport, "_init_device", slow)
    other = HdRig(em, tmp_path, openhaptics__device_name="Second Device", openhaptics__serial="EM0002")
    assert unattended == [False, False]
    for _ in range(100):
        em.c.em_tick()
        for rig, push in ((one, 0.05), (other, -0.08)):
            rig.driver.read()
            rig.driver.write(np.full(3, push))
    assert one.driver.position == pytest.approx([0.0] * 3, abs=COUNT)
    assert other.driver.position == pytest.approx([-0.1] * 3, abs=COUNT)
    assert em.torque(0) == pytest.approx([0.05] * 3, abs=1e-6)
    assert em.torque(1) == pytest.approx([-0.08] * 3, abs=1e-6)
    one.driver.close()
    assert em.off(0)
    assert em.off(1)  # the servo thread stood still meanwhile, which holds the last torque
    first_frames(em)
    other.run(2, (0.0, 0.0, 0.01))
    assert em.torque(1)[2] == pytest.approx(0.01, abs=1e-6)
    other.driver.close()
    assert em.off(1)
    assert em.c.em_running() == 0


def test_the_same_device_twice_is_refused(rig, em, tmp_path):
    with pytest.raises(DeviceError, match="HD_DEVICE_ALREADY_INITIATED"):
        HdRig(em, tmp_path, confirmed=False)
    first_frames(em)
    rig.run(3, PUSH)
    assert em.torque() == pytest.approx(PUSH, abs=1e-6)


def test_a_device_that_does_not_tell_its_temperature_is_no_error(em, tmp_path):
    em.c.em_without_temperature(0)
    rig = HdRig(em, tmp_path)
    rig.settle()
    rig.run(300, PUSH)
    assert rig.latch.latched is None
    rig.driver.close()


# The end, and the real pace.


@pytest.mark.parametrize("pacing", ["callback", "synchronous"])
def test_at_the_end_the_force_is_off_the_callback_gone_and_the_device_released(em, tmp_path, pacing):
    rig = HdRig(em, tmp_path, openhaptics__pacing=pacing)
    rig.settle()
    rig.run(3, PUSH)
    assert not em.off()
    rig.driver.close()
    assert em.off()
    assert (em.c.em_scheduled(), em.c.em_running(), em.c.em_is_open(0)) == (0, 0, 0)
    rig.driver.close()
    assert rig.driver.read() is ReadResult.LOST


@pytest.mark.parametrize("pacing", ["callback", "synchronous"])
def test_the_end_waits_for_no_servo_thread_that_hangs(em, tmp_path, pacing):
    rig = HdRig(em, tmp_path, openhaptics__pacing=pacing)
    rig.settle()
    rig.run(3, PUSH)
    em.c.em_dead(1)
    rig.driver.close()
    assert em.off()
    assert (em.c.em_scheduled(), em.c.em_running(), em.c.em_is_open(0)) == (0, 0, 0)


@pytest.mark.parametrize("pacing", ["callback", "synchronous"])
def test_the_force_of_a_servo_thread_that_hangs_is_off_before_anything_waits_for_that_thread(
    em, tmp_path, monkeypatch, pacing
):
    rig = HdRig(em, tmp_path, openhaptics__pacing=pacing)
    rig.settle()
    rig.run(3, PUSH)
    em.c.em_dead(1)
    library, waiting = load_library(str(em.path)).library, []
    for name in ("hdUnschedule", "hdStopScheduler"):
        call = getattr(library, name)
        spy = lambda *given, call=call: (waiting.append(em.off()), call(*given))  # noqa: E731
        monkeypatch.setattr(library, name, spy)
    rig.driver.close()
    assert waiting == [True, True]


def test_what_a_servo_thread_does_at_its_last_moment_is_taken_away_when_it_stands(rig, em, monkeypatch):
    """It hung in the middle of a frame, and finishes that while the scheduler is being stopped."""
    rig.run(3, PUSH)
    em.c.em_dead(1)
    library = load_library(str(em.path)).library
    stop = library.hdStopScheduler
    monkeypatch.setattr(library, "hdStopScheduler", lambda: (em.c.em_left_on(0), stop()))
    rig.driver.close()
    assert em.off()


def test_the_force_is_off_while_a_servo_thread_that_hangs_is_stopped_for_another_device(
    rig, em, tmp_path, monkeypatch
):
    rig.run(3, PUSH)
    em.c.em_dead(1)
    monkeypatch.setattr(openhaptics, "OPENING_TIME", 0.02)
    library, seen = load_library(str(em.path)).library, []
    start = library.hdStartScheduler
    monkeypatch.setattr(library, "hdStartScheduler", lambda: (seen.append(em.off(0)), start()))
    with pytest.raises(DeviceError, match="servo thread"):
        HdRig(em, tmp_path, openhaptics__device_name="Second Device")
    assert seen == [True, True]


def test_the_callback_itself_takes_the_torque_away_when_it_is_told_to_end(rig, em):
    rig.run(3, PUSH)
    rig.transport._words[hd_frame.CLOSING] = 1
    em.c.em_tick()
    assert em.off()
    assert em.c.em_scheduled() == 0


@pytest.mark.parametrize("pacing", ["callback", "synchronous"])
def test_with_the_library_s_own_thread_it_opens_drives_and_ends(em, tmp_path, monkeypatch, pacing):
    """Frames only in the servo thread, its first ones errors, and the end while it runs."""
    monkeypatch.setattr(openhaptics, "CLOSING_TIME", 0.5)
    em.stepped(False)
    rig = HdRig(em, tmp_path, openhaptics__pacing=pacing, openhaptics__watchdog=0.2, silence=0.2)
    while not em.torque().any():
        rig.driver.read()
        rig.driver.write(np.array(PUSH))
    assert em.torque() == pytest.approx(PUSH, abs=1e-6)
    rig.driver.close()
    assert em.off()
    assert em.c.em_outside() == 0
    assert (em.c.em_scheduled(), em.c.em_running()) == (0, 0)


ENDS_BADLY = """
import sys, numpy as np
sys.path.insert(0, sys.argv[1])
from pathlib import Path
from openhaptics_rig import Emulation, HdRig
em = Emulation(Path(sys.argv[2]))
em.stepped(False)
rig = HdRig(em, Path(sys.argv[3]), silence=0.2, openhaptics__watchdog=0.2)
while not em.torque().any():
    rig.driver.read()
    rig.driver.write(np.array([0.0, 0.1, 0.0]))
raise RuntimeError("a mistake of the program, while a torque acts")
"""


def test_a_program_that_ends_by_a_mistake_leaves_no_torque_behind(hd_library, tmp_path):
    log = tmp_path / "goodbye"
    command = [sys.executable, "-c", ENDS_BADLY, str(Path(__file__).parent), str(hd_library), str(tmp_path)]
    environment = {**os.environ, "EM_LOG": str(log)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=False)
    assert "while a torque acts" in done.stderr
    assert log.read_text() == "0 0 0 0 0\n" * 2


def test_a_captured_session_gives_the_same_states_again(em, tmp_path):
    rig = HdRig(em, tmp_path)
    capture = RawCapture(tmp_path / "session.mcap", "omni", rig.values)
    rig.driver._on_packet = lambda channel, data: capture.add(channel, 0, data)
    states = []
    for sample in range(200):
        em.place(NEUTRAL + 0.001 * sample)
        rig.tick()
        if rig.driver.read() is ReadResult.STATE:
            states.append((rig.driver.position.copy(), rig.driver.velocity.copy(), rig.driver.effort.copy()))
        capture.add("command", 0, np.array(PUSH).tobytes())
        rig.driver.write(np.array(PUSH))
    rig.driver.close()
    capture.close()
    read = read_capture(tmp_path / "session.mcap", "omni")
    again = replay_capture(read, read.parameters)
    node_s = make_driver({"device": "replay"}, rig.reporter, session=Session(read))
    assert node_s.layout.name == "openhaptics", "which the capture itself tells"
    assert len(states) > 100
    assert np.array_equal(again.position, [state[0] for state in states])
    assert np.array_equal(again.velocity, [state[1] for state in states])
    assert np.array_equal(again.effort, [state[2] for state in states])


def test_the_emulated_library_is_the_same_for_a_second_loader(em):
    assert Emulation(em.path).c.em_ticks() == 0
