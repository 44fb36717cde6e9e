"""How a client begins a session with a board server: a greeting that proves both know the key, then the
first sample."""

from __future__ import annotations

from typing import TypeVar

from haptic_teleop_2dsfj.board_settings import BoardSettings
from haptic_teleop_2dsfj.link_error import LinkError
from haptic_teleop_2dsfj.remote import datagrams as d
from haptic_teleop_2dsfj.remote.link import ClientLink
from haptic_teleop_control.clocks import Clock

RETRY = 0.25
"""s after which a greeting without an answer is repeated."""

NO_SAMPLE = "it did not begin with a sample"

Answer = TypeVar("Answer", d.Welcome, d.State)


class Greeting:
    """patience: s for which the server may take to answer. Its calls raise LinkError."""

    def __init__(self, link: ClientLink, patience: float, clock: Clock) -> None:
        self._link, self._patience, self._clock = link, patience, clock

    def hello(self, nonce: bytes, emulated: bool, key: bytes) -> d.Welcome:
        """What the server says of its board. emulated: what kind of board it must have."""
        welcome = self._answer(d.pack(d.Hello(nonce, emulated), key), key, d.Welcome)
        if welcome is None or welcome.nonce != nonce:
            raise link_error(self._link, "it answered somebody else's question")
        return welcome

    def start(self, nonce: bytes, key: bytes) -> d.State:
        """The first sample. key: that of the session."""
        first = self._answer(d.pack(d.Start(nonce), key), key, d.State)
        if first is None:
            raise link_error(self._link, NO_SAMPLE)
        return first

    def _answer(self, greeting: bytes, key: bytes, wanted: type[Answer]) -> Answer | None:
        """The answer of type `wanted` to `greeting`, which is repeated while none comes."""
        end = self._clock.now() + round(self._patience * 1e9)
        hint = "check that it runs, its peer and port, the firewalls, and that both have this version"
        while (now := self._clock.now()) < end:
            self._link.send(greeting)
            until = min(end, now + round(RETRY * 1e9))
            while self._clock.now() < until and (data := self._link.receive(until)) is not None:
                found = d.unpack(data, d.UNSIGNED)
                if isinstance(found, d.Refusal) and found.about_key:
                    # Anybody could have sent it: it only says where to look.
                    hint = "it says that the keys differ: copy the server's key file to this computer"
                    continue
                if d.kind_of(data) in (wanted, d.Refusal):  # not the answer to an earlier repetition
                    answer = opened(data, key, self._link)
                    return answer if isinstance(answer, wanted) else None
        raise link_error(self._link, f"no answer for {self._patience:g} s; {hint}")


def agree(welcome: d.Welcome, board: BoardSettings, link: ClientLink) -> None:
    """Raises LinkError where the server's board is set up otherwise than the driver takes it to be."""
    for name, theirs, ours in (
        ("rate", welcome.rate, board.rate),
        ("board.range", welcome.range_volts, board.range_volts),
        ("board.output_bits", welcome.output_bits, board.output_bits),
        ("board.counter_bits", welcome.counter_bits, board.counter_bits),
    ):
        if theirs != ours:
            raise link_error(link, f"{name} is {theirs:g} there and {ours:g} here; state it alike")


def opened(data: bytes, key: bytes, link: ClientLink) -> d.Datagram:
    """The datagram that `data` is. Raises LinkError where it is none, or the server's refusal."""
    found = d.unpack(data, key)
    if isinstance(found, d.Trouble):
        raise link_error(link, f"a datagram from there {found.value}")
    if isinstance(found, d.Refusal):
        raise link_error(link, found.text)
    return found


def server_name(link: ClientLink) -> str:
    """The server at the other end, as errors name it."""
    return f"board server {link.name}"


def link_error(link: ClientLink, text: str) -> LinkError:
    return LinkError(f"{server_name(link)}: {text}")
