"""Whatever the way to a board server does to datagrams: current flows only while a young command holds it."""

import sys
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parents[1] / "unit"))
from board_wire import Wire

PERIOD, WATCHDOG = 2_000_000, 20_000_000  # ns

EVENTS = st.lists(
    st.one_of(
        st.tuples(st.just("run"), st.integers(1, 15)),
        st.tuples(st.just("client stalls"), st.integers(1, 30)),
        st.tuples(st.just("server stalls"), st.integers(1, 60)),
        st.tuples(st.just("reset"), st.just(0)),
        st.tuples(st.just("delay"), st.integers(0, 40)),
        st.tuples(st.sampled_from(["lose", "double", "spoil", "keep back"]), st.integers(0, 5)),
        st.tuples(st.just("replay"), st.integers(0, 200)),
        st.tuples(st.sampled_from(["unplug", "plug"]), st.just(0)),
    ),
    max_size=25,
)


class Way:
    """What becomes of datagrams: `wanted` of the next ones."""

    def __init__(self) -> None:
        self.wanted: list[str] = []
        self._kept: list[bytes] = []

    def __call__(self, data: bytes) -> list[bytes]:
        what = self.wanted.pop() if self.wanted else ""
        if what == "keep back":
            self._kept.append(data)
            return []
        kept, self._kept = self._kept, []
        change = {"lose": [], "double": [data, data], "spoil": [data[:-1] + bytes([data[-1] ^ 1])]}
        return [*change.get(what, [data]), *kept]


class Watched(Wire):
    """Looks after each sample at what flows, and for how long no young command has held it."""

    def step(self, until: int | None = None) -> None:
        super().step(until)
        self.look()

    def look(self) -> None:
        if self.off or self.hil._gone:  # of a board that is unplugged only its own watchdog knows
            return
        session = self.server.session
        assert session is not None, "it flows for nobody"
        assert not session.expired
        assert self.clock.now() - session.fresh <= WATCHDOG
        newest = max(session.answered, 0)
        assert self.clock.now() - newest <= 2 * WATCHDOG + PERIOD, "it flows for a sample of long ago"


@settings(max_examples=40)
@given(EVENTS)
def test_current_flows_only_while_a_young_command_holds_it(events):
    wire, up, down = Watched(), Way(), Way()
    wire.drive()
    wire.up, wire.down = up, down
    for event, number in events:
        if event == "run":
            for _ in range(number):
                wire.cycle((2.0, 0.4))
                wire.look()
        elif event == "client stalls":
            for _ in range(number):
                wire.step()
        elif event == "server stalls":
            wire.clock.advance(number * 1e-3)
        elif event == "reset":
            wire.reset()
        elif event == "delay":
            wire.delay = number * 1_000_000
        elif event == "replay":
            wire.to_server(wire.sent[number % len(wire.sent)])
            wire.look()
        elif event in ("unplug", "plug"):
            getattr(wire.hil, event)()
        else:
            (up if number % 2 else down).wanted.append(event)
    wire.up = wire.down = lambda data: []
    for _ in range(30):
        wire.step()
    assert wire.off or wire.hil._gone
