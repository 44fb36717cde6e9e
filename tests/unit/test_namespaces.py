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
HOLDS = """
import signal, subprocess, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job of a shell begins deaf to it
sys.path.insert(0, sys.argv[1])
from _namespaces import AT_SERVER, ENDS_WITH_US, Namespaces
with Namespaces() as joined:
    subprocess.run([*joined.enter[1], sys.executable, "-c", sys.argv[2], AT_SERVER], check=True)
    inside = subprocess.Popen([*ENDS_WITH_US, *joined.enter[0], "sleep", "60"])
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
