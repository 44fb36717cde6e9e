"""Child processes that are watched, stopped in order, and never outlive their parent."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence

STOPPING = ((signal.SIGINT, 5.0), (signal.SIGTERM, 2.0), (signal.SIGKILL, 2.0))
"""What a child is sent in turn, and the seconds it is given to end after each."""

_PR_SET_PDEATHSIG = 1
_libc = ctypes.CDLL(None, use_errno=True)


class Child:
    """An executable of this project in a process group of its own, so that Ctrl-C reaches the parent only, who then
    stops the children in order. If the parent dies, the system sends the child SIGTERM.

    Start children before any thread: between fork and exec only the forking thread exists.
    """

    def __init__(self, name: str, arguments: Sequence[str]) -> None:
        self.name = name
        parent = os.getpid()

        def tie_to_parent() -> None:
            _libc.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
            if os.getppid() != parent:  # it died before the line above
                os._exit(1)

        command = [sys.executable, "-m", "haptic_teleop_control.front_door", name, *arguments]
        self.process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, start_new_session=True, preexec_fn=tie_to_parent
        )

    @property
    def status(self) -> int | None:
        """Exit status as a shell gives it (128 + signal), or None while it runs."""
        code = self.process.poll()
        return 128 - code if code is not None and code < 0 else code

    def request_stop(self) -> None:
        self._send(STOPPING[0][0])

    def stop(self) -> int:
        """Ends it, by force where it must be; its exit status."""
        for number, patience in STOPPING:
            if self.status is not None:
                break
            self._send(number)
            try:
                self.process.wait(patience)
            except subprocess.TimeoutExpired:
                print(f"{self.name} has not ended {patience:g} s after {number.name}", file=sys.stderr)
        status = self.status
        return 1 if status is None else status

    def _send(self, number: signal.Signals) -> None:
        if self.process.poll() is None:
            self.process.send_signal(number)


def stop_all(children: Sequence[Child]) -> dict[str, int]:
    """Stops several children at the same time; exit statuses by name."""
    for child in children:
        child.request_stop()
    deadline = time.monotonic() + STOPPING[0][1]
    while time.monotonic() < deadline and any(child.status is None for child in children):
        time.sleep(0.02)
    return {child.name: child.stop() for child in children}
