"""Datagrams over UDP, for either end: `receive` waits until a moment of the steady clock and no longer."""

from __future__ import annotations

import socket
from typing import Protocol, TypeAlias

from haptic_teleop_2dsfj.link_error import LinkError
from haptic_teleop_2dsfj.remote.datagrams import LARGEST
from haptic_teleop_control.clocks import Clock, SteadyClock
from haptic_teleop_control.errors import ConfigurationError

Address: TypeAlias = tuple[str, int]
PORT = 28765
"""Below the ports that systems hand out by themselves."""


class ClientLink(Protocol):
    """The client's way to one server. Raises LinkError where nobody is at its other end."""

    name: str

    def open(self) -> None: ...
    def send(self, data: bytes) -> None: ...
    def receive(self, until: int) -> bytes | None: ...
    def close(self) -> None: ...


class UdpClient:
    """host, port: of the server. Only what comes from there is received."""

    def __init__(self, host: str, port: int, clock: Clock | None = None) -> None:
        self.name = f"{host}:{port}"
        self._address = (host, port)
        self._clock = clock or SteadyClock()
        self._socket: socket.socket | None = None

    def open(self) -> None:
        self.close()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.connect(self._address)
        except OSError as error:
            self.close()
            raise LinkError(
                f"board server {self.name}: {error.strerror or error}", error.errno or 0
            ) from error

    def send(self, data: bytes) -> None:
        try:
            self._open_socket().send(data)
        except OSError as error:
            raise self._gone(error) from error

    def receive(self, until: int) -> bytes | None:
        """The next datagram, or None when none has come by `until`, ns."""
        connected = self._open_socket()
        connected.settimeout(max(0.0, (until - self._clock.now()) * 1e-9))
        try:
            return connected.recv(LARGEST)
        except (TimeoutError, BlockingIOError):
            return None
        except OSError as error:
            raise self._gone(error) from error

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _open_socket(self) -> socket.socket:
        if self._socket is None:
            raise LinkError(f"board server {self.name}: the connection is closed")
        return self._socket

    def _gone(self, error: OSError) -> LinkError:
        if isinstance(error, ConnectionError):  # the other computer's answer to a port without a program
            return LinkError(
                f"nothing listens at {self.name}; start sfj_board_server there, or correct remote.host and "
                "remote.port"
            )
        return LinkError(f"board server {self.name}: {error.strerror or error}", error.errno or 0)


class UdpServer:
    """Receives from everybody; who may say something is the server's to decide. Raises ConfigurationError
    where the address cannot be had."""

    def __init__(self, host: str, port: int, clock: Clock | None = None) -> None:
        self._clock = clock or SteadyClock()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        # On Windows another program could otherwise bind the same port and take the datagrams.
        exclusive = getattr(socket, "SO_EXCLUSIVEADDRUSE", None)
        if exclusive is not None:
            self._socket.setsockopt(socket.SOL_SOCKET, exclusive, 1)
        try:
            self._socket.bind((host, port))
        except OSError as error:
            self._socket.close()
            raise ConfigurationError(
                f"cannot listen at {host}:{port} ({error.strerror or error}); end the other board server, or "
                "set host to an address of this computer and port to a free one."
            ) from error
        self.address: Address = self._socket.getsockname()

    def send(self, data: bytes, address: Address) -> None:
        """What cannot be sent is lost, as on the way."""
        try:
            self._socket.sendto(data, address)
        except OSError:
            return

    def receive(self, until: int) -> tuple[bytes, Address] | None:
        """The next datagram and its sender, or None when none has come by `until`, ns."""
        while True:
            self._socket.settimeout(max(0.0, (until - self._clock.now()) * 1e-9))
            try:
                return self._socket.recvfrom(LARGEST)
            except (TimeoutError, BlockingIOError):
                return None
            except ConnectionError:
                continue  # Windows: that nobody took an earlier datagram, which silence shows as well
            except OSError:  # Windows again: one that is longer than LARGEST, and is none of ours
                return b"", ("", 0)

    def close(self) -> None:
        self._socket.close()
