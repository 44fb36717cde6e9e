"""The network namespaces of `tests/benchmarks/board_round_trip.py`: joined, and gone however their program
ends."""

import os
import select
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).resolve().parents[1] / "benchmarks"
sys.path.insert(0, str(BENCHMARKS))
from _namespaces import ends_with_us  # noqa: E402

HOLDS = """
import signal, subprocess, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job of a shell begins deaf to it
sys.path.insert(0, sys.argv[1])
from _namespaces import AT_SERVER, Namespaces, ends_with_us
with Namespaces() as joined:
    subprocess.run([*joined.enter[1], sys.executable, "-c", sys.argv[2], AT_SERVER], check=True)
    inside = subprocess.Popen([*ends_with_us(), *joined.enter[0], "sleep", "60"])
    print(*joined.keepers, inside.pid, flush=True)
    sys.stdin.read()
"""

ASKS = """
import contextlib, socket, sys
asking = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
asking.settimeout(10.0)
asking.connect((sys.argv[1], 9))
asking.send(b"?")
with contextlib.suppress(ConnectionRefusedError):  # the other end's answer to a port without a program
    asking.recv(1)
"""


def gone(process: int, within: float = 10.0) -> bool:
    """Whether the process ends, waiting for just that."""
    try:
        descriptor = os.pidfd_open(process)
    except ProcessLookupError:
        return True
    try:
        return bool(select.select([descriptor], [], [], within)[0])
    finally:
        os.close(descriptor)


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT, None])
def test_of_the_namespaces_nothing_is_left_however_their_program_ends(number):
    may = ["unshare", "--net", "true"]
    if shutil.which(may[0]) is None or subprocess.run(may, check=False).returncode:
        pytest.skip("this user may make no network namespaces")
    program = subprocess.Popen(
        [sys.executable, "-c", HOLDS, str(BENCHMARKS), ASKS],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        line = program.stdout.readline()
        assert line, program.stderr.read()
        *keepers, inside = map(int, line.split())
        networks = {os.readlink(f"/proc/{process}/ns/net") for process in (*keepers, os.getpid())}
        assert len(networks) == 3
        assert os.readlink(f"/proc/{inside}/ns/net") in networks
        if number is None:
            program.stdin.close()
            program.stdin = None
        else:
            program.send_signal(number)
        assert gone(program.pid)
        assert all(gone(process) for process in (*keepers, inside))
    finally:
        program.kill()
        program.communicate()


def test_what_is_to_end_with_a_program_does_not_begin_when_that_has_ended_already():
    """The kernel tells of a parent's end only who asked for it before."""
    if shutil.which("setpriv") is None:
        pytest.skip("setpriv is not here")
    asks = (
        "import sys; sys.path.insert(0, sys.argv[1]); import _namespaces\n"
        "print(*_namespaces.ends_with_us(), sep='\\n')"
    )
    other = [sys.executable, "-c", asks, str(BENCHMARKS)]
    ended = subprocess.run(other, check=True, stdout=subprocess.PIPE, text=True).stdout.splitlines()
    for command, said in ((ended, ""), (ends_with_us(), "begun\n")):
        done = subprocess.run([*command, "echo", "begun"], check=False, stdout=subprocess.PIPE, text=True)
        assert done.stdout == said
