"""A participant's side of simulated time: joins, hears ticks, says what it has done. Pure.

Whoever hears a tick a second time says again what it said: a state, an answer, that it waits. So nothing that
is lost on the way stops time, and nothing is done twice.
"""

from __future__ import annotations

import secrets
from collections.abc import Callable, Mapping
from typing import Any

from haptic_teleop_control.simulated_time.messages import (
    HALTED,
    OVER,
    PAUSED,
    WAITING,
    WITHDRAWN,
    Member,
    Report,
    Status,
    Tick,
)
from haptic_teleop_control.simulated_time.stamps import ORIGIN

LONGEST_STEP = 0.1
JOIN_INTERVAL = 0.1
"""s between two attempts to join."""
COORDINATOR_LIVENESS = 10.0
"""s without a word from the coordinator. Longer than its own patience with us: who names the culprit must
come first, and a child of `scenario` that was killed is seen at once anyway."""


class Participant:
    """member: itself. say: sends a report. on_tick(tick, repeated): called for every tick, also those that
    ask nothing of it. on_fault(detail): time is halted, or its coordinator is lost after it began; once.
    on_refused(detail): the coordinator does not take it; once, and nothing else is called then. on_joined:
    it takes part from now on. on_status: every status. liveness: s without a word from the coordinator.
    run: of the `scenario` that has started it; it then hears only that one's coordinator.
    """

    def __init__(
        self,
        member: Member,
        say: Callable[[Report], None],
        on_tick: Callable[[Tick, bool], None],
        on_fault: Callable[[str], None],
        on_refused: Callable[[str], None],
        on_status: Callable[[Status], None] = lambda status: None,
        on_joined: Callable[[], None] = lambda: None,
        liveness: float = COORDINATOR_LIVENESS,
        run: str = "",
    ) -> None:
        self.member = member
        self.sender = secrets.token_hex(4)
        self.stamp = ORIGIN
        self.tick: Tick | None = None
        self.joined = False
        self.state = self._reason = ""
        self._send, self._on_tick, self._on_status = say, on_tick, on_status
        self._on_fault, self._on_refused, self._on_joined = on_fault, on_refused, on_joined
        self._liveness, self._run = liveness, run
        self._session = ""
        self._faulty = False
        self._lived = self._heard = 0.0
        self._next_join = 0.0
        self._last_wall: float | None = None

    def hear(self, message: Tick | Status) -> None:
        """Takes an announcement of the coordinator; that of another one changes nothing."""
        if isinstance(message, Status) and self._run and message.run != self._run:
            return
        if self._session and message.session != self._session:
            if self.state == OVER and isinstance(message, Status) and message.run == self._run:
                self._fault("simulated time is over, and begins anew elsewhere; start this node anew, too")
            return
        self._heard = self._lived
        if isinstance(message, Status):
            self._take_status(message)
            return
        if not self.joined or self._faulty:
            return
        if message.number == 0:
            self._say("done", what=message.session)
            return
        last = 0 if self.tick is None else self.tick.number
        if message.number < last:
            return  # overtaken on its way
        self.tick, self.stamp = message, message.stamp
        self._on_tick(message, message.number == last)

    def poll(self, wall: float) -> None:
        """Joins, and looks whether the coordinator is there; to be called now and then."""
        if self._last_wall is not None:
            self._lived += min(max(0.0, wall - self._last_wall), LONGEST_STEP)
        self._last_wall = wall
        if not self.joined:
            if self._lived >= self._next_join:
                self._next_join = self._lived + JOIN_INTERVAL
                self._say("join", member=self.member)
        elif self._lived - self._heard > self._liveness and self.state != OVER:
            if self.state == WAITING:
                self._turn_to_another()
                return
            self._fault(f"the coordinator of simulated time has been silent for {self._liveness:g} s")

    @property
    def waited(self) -> float:
        """s that it has been waiting to take part; 0 when it does."""
        return 0.0 if self.joined or self._faulty else self._lived

    @property
    def waits_for(self) -> str:
        """What keeps time from beginning, in words; empty once it has begun."""
        if self._faulty:
            return ""
        if not self.joined:
            return "a coordinator of simulated time"
        return self._reason.removeprefix("waiting for ") if self.state == WAITING else ""

    @property
    def over(self) -> bool:
        """Whether the coordinator has said that time is over."""
        return self.state == OVER

    def done(self, stamps: Mapping[str, int] | None = None, silent: bool = False) -> None:
        """What the tick asked is done. stamps: of a linked answerer, way -> newest stamp sent. silent: of a
        plant, its next sample will not be published."""
        if self.tick is not None:
            number = self.tick.number
            self._say("done", number=number, stamps=stamps or {}, silent=silent)

    def waiting(self, what: str) -> None:
        """The tick came again, and `what` is still waited for."""
        if self.tick is not None:
            self._say("waiting", number=self.tick.number, what=what)

    def recorded(self, stamps: Mapping[str, int]) -> None:
        """A recorder has kept these topics up to these stamps."""
        self._say("recorded", stamps=dict(stamps))

    def taken(self, way: str, sent: int, arrivals: tuple[int, ...]) -> None:
        """The link has taken the packet stamped `sent`."""
        self._say("taken", stamps={way: sent}, arrivals=arrivals)

    def leave(self) -> None:
        """It takes no part any more."""
        if self.joined:
            self._say("left")
        self.joined = False

    def _say(self, act: str, **content: Any) -> None:
        self._send(Report(self.member.name, act, sender=self.sender, run=self._run, **content))

    def _take_status(self, status: Status) -> None:
        if not self.joined:
            refusal = status.refused.get(self.sender)
            if refusal is not None and not self._faulty:
                self._faulty = True
                self._on_refused(f"the coordinator of simulated time refuses {self.member.name}: {refusal}")
            if self.sender not in status.senders:
                return
            self.joined, self._session = True, status.session
            self._on_joined()
        if status.state == WITHDRAWN:
            self._turn_to_another()
            return
        self.state, self._reason = status.state, status.reason
        if status.state == HALTED:
            self._fault(f"simulated time is halted: {status.reason}")
        elif status.state in (PAUSED, OVER):
            self.stamp = max(self.stamp, status.stamp)
        self._on_status(status)

    def _turn_to_another(self) -> None:
        """It takes no part with a coordinator that is gone before time began, and tries to join again."""
        self.joined, self._session, self.state = False, "", ""

    def _fault(self, detail: str) -> None:
        if not self._faulty:
            self._faulty = True
            if self.joined and self.state != HALTED:
                self._say("left", what=f"takes no part any more: {detail}")
            self._on_fault(detail)
