"""A process that has done its work ends with its status, whatever a library does while it is closed."""

import subprocess
import sys
import time

import pytest

from haptic_teleop_control.forced_exit import ends_within

HANGS = """
import ctypes
from haptic_teleop_control.forced_exit import ends_within
print("done", end="")  # no newline: it has to be flushed all the same
with ends_within(0.3, {status}):
    ctypes.PyDLL(None).pause()  # waits for good, and holds the interpreter
"""


@pytest.mark.parametrize("status", [0, 1, 3])
def test_a_library_that_hangs_with_the_interpreter_does_not_keep_the_process(status):
    ran = subprocess.run(
        [sys.executable, "-c", HANGS.format(status=status)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (ran.returncode, ran.stdout, ran.stderr) == (status, "done", "")


def test_a_body_that_ends_changes_nothing():
    with ends_within(0.05, 9):
        pass
    time.sleep(0.2)  # the timer would have ended this process by now


def test_a_failure_of_the_body_is_told():
    with pytest.raises(ValueError, match="mine"), ends_within(0.05, 9):
        raise ValueError("mine")
    time.sleep(0.2)
