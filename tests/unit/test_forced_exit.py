"""A process that has done its work ends with its status, whatever a library does while it is closed."""

import subprocess
import sys

import pytest

from haptic_teleop_control import forced_exit
from haptic_teleop_control.forced_exit import ends_within

HANGS = """
import ctypes
from haptic_teleop_control.forced_exit import ends_within
print("done", end="")  # no newline: it has to be flushed all the same
with ends_within(0.3, {status}):
    ctypes.PyDLL(None).pause()  # waits for good, and holds the interpreter
"""
UNREAD = """
import os, sys
from haptic_teleop_control.forced_exit import ends_within
reading, writing = os.pipe()
os.close(reading)
sys.stdout = os.fdopen(writing, "w")
print("nobody reads this", end="")
with ends_within(5.0, 1):
    os._exit(7)
"""


def run(code):
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)


@pytest.mark.parametrize("status", [0, 1, 3])
def test_a_library_that_hangs_with_the_interpreter_does_not_keep_the_process(status):
    ran = run(HANGS.format(status=status))
    assert (ran.returncode, ran.stdout, ran.stderr) == (status, "done", "")


def test_words_that_nobody_reads_do_not_keep_the_process_from_its_end():
    ran = run(UNREAD)
    assert (ran.returncode, ran.stderr) == (7, "")


class Timers:
    """Timers of a system that only notes what it is asked for."""

    def __init__(self, none_left=False):
        self.asked, self.none_left = [], none_left

    def timer_create(self, *_):
        self.asked.append("create")
        return -1 if self.none_left else 0

    def timer_settime(self, *_):
        self.asked.append("set")

    def timer_delete(self, *_):
        self.asked.append("delete")


def test_a_body_that_ends_changes_nothing(monkeypatch):
    timers = Timers()
    monkeypatch.setattr(forced_exit, "_timers", lambda: timers)
    with ends_within(5.0, 9):
        assert timers.asked == ["create", "set"]
    assert timers.asked == ["create", "set", "delete"]


def test_a_failure_of_the_body_is_told(monkeypatch):
    timers = Timers()
    monkeypatch.setattr(forced_exit, "_timers", lambda: timers)
    with pytest.raises(ValueError, match="mine"), ends_within(5.0, 9):
        raise ValueError("mine")
    assert timers.asked[-1] == "delete"


@pytest.mark.parametrize("timers", [None, Timers(none_left=True)])
def test_where_no_timer_is_to_be_had_the_body_runs_without(monkeypatch, timers):
    monkeypatch.setattr(forced_exit, "_timers", lambda: timers)
    ran = []
    with ends_within(5.0, 9):
        ran.append(True)
    assert ran and (timers is None or timers.asked == ["create"])


def test_this_system_has_timers():
    assert forced_exit._timers() is not None
