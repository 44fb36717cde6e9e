"""The datagrams between driver and board server: little endian, a fixed size for each kind, signed.

    magic (4) | version (1) | kind (1) | body | HMAC-SHA256 of all before it, its first 16 bytes

A session begins with three: Hello (client's nonce), Welcome (server's offer, and what board it has), Start.
From then on the server sends a State for each sample and the client a Command for each State, signed with a
key that both nonces make and that no other session has. Stamps are ns of the steady clock of who wrote them.
"""

from __future__ import annotations

import hmac
import struct
from enum import Enum
from typing import NamedTuple, TypeAlias

MAGIC, VERSION = b"SFJB", 1
TAG_BYTES = NONCE_BYTES = 16
LARGEST = 1024
"""Bytes to be received at once: more than any datagram has, so that one that is too long shows."""

SHORT_TEXT, LONG_TEXT = 32, 240


class Trouble(Enum):
    """What is wrong with a datagram, as the end of a sentence."""

    LENGTH = "has a wrong length"
    FOREIGN = "is none of this protocol, or of another version of it"
    KEY = "is not signed with the key of this session"
    DUPLICATED = "came before: it is duplicated or replayed"
    REORDERED = "was overtaken by a later one"
    SECOND_CLIENT = "is of a second client"
    VALUE = "asks for more than highest_volts, or for no finite number"
    UNEXPECTED = "has no place here"


class Hello(NamedTuple):
    """Asks for a session."""

    nonce: bytes
    emulated: bool
    """Whether the client expects an emulated board."""


class Probe(NamedTuple):
    """Asks what is there, and disturbs nobody."""

    nonce: bytes


class Welcome(NamedTuple):
    """What is there; answers Hello and Probe."""

    nonce: bytes
    offer: bytes
    emulated: bool
    busy: bool
    rate: float
    range_volts: float
    output_bits: int
    counter_bits: int
    watchdog: float
    card_type: str
    card_identifier: str


class Start(NamedTuple):
    """Begins the session whose key it is signed with."""

    nonce: bytes


class State(NamedTuple):
    """A sample of the board. stamp: when it was read; sent: when this left; echo: the stamp of the last
    Command, heard: when that came; passed: samples since the server began; rearmed: the client's last
    request that was done; expired: `Expiry`."""

    sequence: int
    stamp: int
    sent: int
    echo: int
    heard: int
    passed: int
    rearmed: int
    enabled: bool
    expired: int
    counts: tuple[int, ...]
    senses: tuple[float, ...]
    switches: tuple[int, ...]


class Command(NamedTuple):
    """All that the board shall do from now on. answers: stamp of the State it answers, arrived: when that
    came; rearm: number of the request to clear the board's watchdog; leaves: whether the session is over."""

    sequence: int
    stamp: int
    answers: int
    arrived: int
    rearm: int
    enable: bool
    leaves: bool
    first: float
    second: float


class Refusal(NamedTuple):
    """Why there is no session, or none any more. about_key: the datagram refused was signed with another key;
    only then it is not signed itself."""

    about_key: bool
    text: str


Datagram: TypeAlias = Hello | Probe | Welcome | Start | State | Command | Refusal

_HEADER = struct.Struct("<4sBB")
_KINDS: tuple[type[Datagram], ...] = (Hello, Welcome, Start, State, Command, Refusal, Probe)
_BODIES = {
    Hello: struct.Struct("<16s?"),
    Welcome: struct.Struct(f"<16s16s??ddBBd{SHORT_TEXT}s{SHORT_TEXT}s"),
    Start: struct.Struct("<16s"),
    State: struct.Struct("<QqqqqQI?B4i2d4b"),
    Command: struct.Struct("<QqqqI??2d"),
    Refusal: struct.Struct(f"<?{LONG_TEXT}s"),
    Probe: struct.Struct("<16s"),
}
_CODES = {kind: code for code, kind in enumerate(_KINDS, start=1)}
_SIZES = {kind: _HEADER.size + body.size + TAG_BYTES for kind, body in _BODIES.items()}
_TEXTS = {Welcome: (SHORT_TEXT, SHORT_TEXT), Refusal: (LONG_TEXT,)}
UNSIGNED = b""
"""As key: a refusal about the key itself, which cannot be signed with it."""


def session_key(shared: bytes, nonce: bytes, offer: bytes) -> bytes:
    """The key of one session: the client's nonce keeps a server's datagrams from being replayed, the server's
    offer a client's."""
    return hmac.digest(shared, b"session" + nonce + offer, "sha256")


def pack(datagram: Datagram, key: bytes) -> bytes:
    """`datagram` signed with `key`; texts are cut to their field."""
    kind = type(datagram)
    values: list = []
    for value in datagram:
        if isinstance(value, tuple):
            values += value
        elif isinstance(value, str):
            values.append(_cut(value, LONG_TEXT if kind is Refusal else SHORT_TEXT))
        else:
            values.append(value)
    data = _HEADER.pack(MAGIC, VERSION, _CODES[kind]) + _BODIES[kind].pack(*values)
    return data + _tag(key, data)


def kind_of(data: bytes) -> type[Datagram] | Trouble:
    """What `data` says that it is; its length is that of its kind, and nothing else is known of it."""
    if len(data) < _HEADER.size:
        return Trouble.LENGTH
    magic, version, code = _HEADER.unpack_from(data)
    if magic != MAGIC or version != VERSION or not 1 <= code <= len(_KINDS):
        return Trouble.FOREIGN
    kind = _KINDS[code - 1]
    return kind if len(data) == _SIZES[kind] else Trouble.LENGTH


def unpack(data: bytes, key: bytes) -> Datagram | Trouble:
    """The datagram in `data`, whose signature holds; or what is wrong with it."""
    kind = kind_of(data)
    if isinstance(kind, Trouble):
        return kind
    if not hmac.compare_digest(data[-TAG_BYTES:], _tag(key, data[:-TAG_BYTES])):
        return Trouble.KEY
    values = _BODIES[kind].unpack_from(data, _HEADER.size)
    if kind is State:
        return State._make((*values[:9], values[9:13], values[13:15], values[15:19]))
    texts = len(_TEXTS.get(kind, ()))
    if texts:
        values = (*values[:-texts], *(_text(value) for value in values[-texts:]))
    return kind(*values)


def unsigned_start(data: bytes) -> Start:
    """A Start as it stands, for the nonce that its key is made of; nothing is known of its signature."""
    return Start(*_BODIES[Start].unpack_from(data, _HEADER.size))


def _tag(key: bytes, data: bytes) -> bytes:
    return hmac.digest(key, data, "sha256")[:TAG_BYTES] if key else bytes(TAG_BYTES)


def _cut(text: str, size: int) -> bytes:
    return text.encode()[:size]


def _text(data: bytes) -> str:
    return data.rstrip(b"\0").decode(errors="replace")
