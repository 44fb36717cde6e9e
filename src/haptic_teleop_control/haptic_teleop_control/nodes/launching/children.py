"""Child processes that are watched, stopped in order, and never outlive their parent."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Sequence

from haptic_teleop_control.nodes.launching.parent import OPTION, ParentChannel
from haptic_teleop_control.nodes.launching.stopping import STOP_SIGNALS
from haptic_teleop_control.parent_death import ends_with_parent
from haptic_teleop_control.simulated_time.runs import VARIABLE

STOPPING = ((signal.SIGINT, 8.0), (signal.SIGTERM, 2.0), (signal.SIGKILL, 2.0))
"""What a child is sent in turn, and the seconds it is given to end after each."""

_POLL = 0.02


class Child:
    """An executable of this project in a session of its own, so that Ctrl-C reaches only the parent, who then
    stops the children in order. If the parent dies, the system sends the child SIGTERM.

    Its standard error comes through the parent (`relay`), who may be keeping a live line on the terminal.
    An `armed` child waits before its nodes start for what comes over `link`.
    run: id of the run of `scenario` that starts it.
    Start children before any thread: between fork and exec only the forking thread exists.
    """

    def __init__(self, name: str, arguments: Sequence[str], armed: bool = False, run: str = "") -> None:
        self.name = name
        self._text = b""
        ours, theirs = socket.socketpair()
        self.link = ParentChannel(ours)
        option = [OPTION] if armed else []
        with theirs:
            self.process = subprocess.Popen(
                [sys.executable, "-P", "-m", "haptic_teleop_control.front_door", name, *option, *arguments],
                stdin=theirs if armed else subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                start_new_session=True,
                env={**os.environ, VARIABLE: run},
                # A signal that comes before the child has its handlers waits for them (`stop_requests`).
                preexec_fn=ends_with_parent(STOP_SIGNALS),
            )
        assert self.process.stderr is not None
        self._pipe = self.process.stderr.fileno()
        os.set_blocking(self._pipe, False)

    @property
    def status(self) -> int | None:
        """Exit status as a shell gives it (128 + signal), or None while it runs."""
        code = self.process.poll()
        return 128 - code if code is not None and code < 0 else code

    def relay(self) -> list[str]:
        """Passes on the lines that it has written to standard error since; also returns them."""
        while True:
            try:
                data = os.read(self._pipe, 65536)
            except BlockingIOError:
                break
            if not data:
                break
            self._text += data
        *lines, self._text = self._text.split(b"\n")
        if self._text and self.process.poll() is not None:
            lines, self._text = [*lines, self._text], b""
        decoded = [line.decode(errors="replace") for line in lines]
        for line in decoded:
            print(line, file=sys.stderr, flush=True)
        return decoded

    def request_stop(self) -> None:
        self._send(STOPPING[0][0])

    def stop(self) -> int:
        """Ends it, by force where it must be; its exit status."""
        for number, patience in STOPPING:
            if self.status is not None:
                break
            self._send(number)
            if not _ended([self], patience):
                print(f"{self.name} has not ended {patience:g} s after {number.name}", file=sys.stderr)
        self.relay()
        status = self.status
        return 1 if status is None else status

    def _send(self, number: signal.Signals) -> None:
        if self.process.poll() is None:
            self.process.send_signal(number)


def stop_all(children: Sequence[Child]) -> dict[str, int]:
    """Stops several children at the same time; exit statuses by name."""
    for child in children:
        child.request_stop()
    _ended(children, STOPPING[0][1])
    return {child.name: child.stop() for child in children}


def _ended(children: Sequence[Child], patience: float) -> bool:
    deadline = time.monotonic() + patience
    while any(child.status is None for child in children):
        if time.monotonic() > deadline:
            return False
        time.sleep(_POLL)
        for child in children:
            child.relay()
    return True
