"""One question to a board server, which disturbs no session: what it has, and whether somebody drives it."""

from __future__ import annotations

import secrets

from haptic_teleop_2dsfj.link_error import LinkError
from haptic_teleop_2dsfj.remote import datagrams as d
from haptic_teleop_2dsfj.remote.key_file import read_key
from haptic_teleop_2dsfj.remote.link import PORT, UdpClient
from haptic_teleop_control.clocks import SteadyClock
from haptic_teleop_control.errors import ConfigurationError

TRIES, PATIENCE = 4, 0.25
"""Questions, and s for which each waits."""


def probe(address: str, key_file: str = "") -> d.Welcome:
    """What the server at `address`, HOST or HOST:PORT, says of itself. Raises LinkError where it does not
    answer, ConfigurationError for an address or a key that is none."""
    host, colon, port = address.partition(":")
    if not host or (colon and not (port.isdigit() and 0 < int(port) < 65536)):
        raise ConfigurationError(f"--board {address}: is no address; write HOST or HOST:PORT.")
    key, clock = read_key(key_file), SteadyClock()
    link = UdpClient(host, int(port) if colon else PORT, clock)
    link.open()
    hint = "check that it runs, its peer and port, the firewalls, and that both have this version"
    try:
        for _ in range(TRIES):
            nonce = secrets.token_bytes(d.NONCE_BYTES)
            link.send(d.pack(d.Probe(nonce), key))
            until = clock.now() + round(PATIENCE * 1e9)
            while clock.now() < until and (data := link.receive(until)) is not None:
                found = d.unpack(data, key)
                if isinstance(found, d.Welcome) and found.nonce == nonce:
                    return found
                if isinstance(d.unpack(data, d.UNSIGNED), d.Refusal):
                    hint = "it says that the keys differ: copy the server's key file to this computer"
    finally:
        link.close()
    raise LinkError(f"board server {link.name}: no answer for {TRIES * PATIENCE:g} s; {hint}")
