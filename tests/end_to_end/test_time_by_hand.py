"""Simulated time in the operator's hands: nodes started one by one, time paused, stepped and let go on."""

import re
import signal
import subprocess
import sys
from contextlib import contextmanager

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2: `make setup`, or source an installation")

FRONT_DOOR = (sys.executable, "-m", "haptic_teleop_control.front_door")
SIMULATED = ("--ros-args", "-p", "use_sim_time:=true")


@contextmanager
def shell(*arguments: str):
    """An executable as somebody starts it in a shell of its own, stopped with Ctrl-C at the end."""
    with subprocess.Popen([*FRONT_DOOR, *arguments], stderr=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=30)


def until_it_says(process: subprocess.Popen, words: str) -> str:
    """The line; there is none if the process ends before."""
    assert process.stderr is not None
    return next(line for line in process.stderr if words in line)


def operate(*arguments: str) -> tuple[int, str]:
    done = subprocess.run([*FRONT_DOOR, "operate", *arguments], capture_output=True, text=True, timeout=60)
    errors = [line for line in done.stderr.splitlines() if line.startswith("error:")]  # others are DDS'
    return done.returncode, "\n".join([*done.stdout.splitlines(), *errors])


def moment(said: str) -> float:
    """The simulated time that `operate` tells, s."""
    (found,) = re.findall(r"done at ([\d.]+) s", said)
    return float(found)


@pytest.mark.long
def test_time_of_nodes_started_by_hand_is_awaited_paused_stepped_and_let_go_on(ros_isolation):
    coordinator = ("time_coordinator", "--ros-args", "-p", "participants:=[sfj_sim]")
    with shell(*coordinator) as waiting:
        assert "use_sim_time: true" in until_it_says(waiting, "waiting for sfj_sim")
        status, said = operate("pause")
        assert status == 1 and "waiting for sfj_sim" in said
        with shell("sfj_sim", *SIMULATED):
            until_it_says(waiting, "all participants are there")
            status, said = operate("step")
            assert status == 1 and "pause it before" in said
            status, said = operate("pause")
            assert status == 0
            begin = moment(said)
            for step in (1, 2, 3):  # the 2DSFJ has 500 Hz
                status, said = operate("step")
                assert status == 0 and moment(said) == pytest.approx(begin + 0.002 * step, abs=1e-9)
            assert operate("pause") == (1, "pause: refused: time is paused")
            assert operate("resume")[0] == 0
            assert moment(operate("pause")[1]) > begin + 0.006


def test_a_node_that_nobody_gives_time_says_whom_it_needs_and_there_is_nothing_to_pause(ros_isolation):
    with shell("sfj_sim", *SIMULATED) as alone:
        assert "time_coordinator" in until_it_says(alone, "no coordinator of simulated time")
        status, said = operate("pause", "--wait", "1")
        assert status == 2 and "time is not simulated here" in said and len(said.splitlines()) == 1
