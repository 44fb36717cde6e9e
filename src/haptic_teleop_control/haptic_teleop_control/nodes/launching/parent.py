"""Short messages between a process and the one that started it, both ways, apart from its output.

The child's standard input is one end of a socket pair; each message is a JSON object on a line of its own.
"""

from __future__ import annotations

import json
import socket
from typing import Any

from haptic_teleop_control.errors import ConfigurationError

OPTION = "--armed"
"""Tells an executable that its standard input is such a socket. For parents only, so no help names it."""


class ParentChannel:
    """One end. `closed` is true when the other process has gone; sending then does nothing."""

    def __init__(self, end: socket.socket) -> None:
        self._socket = end
        self._socket.setblocking(False)
        self._text = b""
        self.closed = False

    @classmethod
    def to_parent(cls) -> ParentChannel:
        """The child's end. Raises ConfigurationError when standard input is no socket."""
        try:
            return cls(socket.socket(fileno=0))
        except OSError:
            raise ConfigurationError(
                f"{OPTION} is what `scenario` starts its nodes with; leave it out."
            ) from None

    def send(self, **content: Any) -> None:
        """Sends one message. They are some kilobytes at most, which the system's buffer always takes."""
        try:
            self._socket.sendall(json.dumps(content).encode() + b"\n")
        except OSError:
            self.closed = True

    def receive(self) -> list[dict[str, Any]]:
        """The messages that have arrived since; never waits."""
        while not self.closed:
            try:
                data = self._socket.recv(65536)
            except BlockingIOError:
                break
            except OSError:
                data = b""
            self.closed = not data
            self._text += data
        *lines, self._text = self._text.split(b"\n")
        return [json.loads(line) for line in lines]
