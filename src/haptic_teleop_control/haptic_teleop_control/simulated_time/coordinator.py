"""Grants simulated time tick by tick: the next one when everybody has done what the last one asked.

No clock is read here: `wall` is what the caller's steady clock says, in s. What is owed is asked for again
after `REPEAT`; who owes something and has not been heard of for `liveness` seconds halts time, and is named.
Only time during which this object was called counts, so that a machine that stood still accuses nobody. The
default of 5 s bears that one process is stopped for 1.5 s twice running on a busy machine (2 s did not).
"""

from __future__ import annotations

import secrets
from collections.abc import Iterable

from haptic_teleop_control.simulated_time.kept import Kept, longest_lead
from haptic_teleop_control.simulated_time.messages import (
    ANSWERER,
    BEGUN,
    ENDED,
    HALTED,
    LINK,
    OVER,
    PAUSED,
    PLANT,
    RECORDER,
    RUNNING,
    SOURCE,
    WAITING,
    WITHDRAWN,
    Member,
    Report,
    Status,
    Tick,
)
from haptic_teleop_control.simulated_time.pace import Pace
from haptic_teleop_control.simulated_time.schedule import Schedule
from haptic_teleop_control.simulated_time.stamps import ORIGIN, seconds

REPEAT = 0.05
"""s after which what is owed is asked for again."""
HEARTBEAT = 0.2
"""s between two statuses at most."""
LONGEST_STEP = 0.1
"""s counted at most between two calls: what is longer, we stood still ourselves."""
STUCK = 5
"""Times the liveness that one tick may take although everybody is heard of: they then misunderstand each
other, and waiting does not help."""
RECORDER_LIVENESS = 15.0
"""s of silence that a recorder is granted at least: a busy disk may hold it for seconds, and it then loses
nothing."""


class Coordinator:
    """participants: bare or full names of the nodes that must join before time begins; others may, until
    then. duration: s, 0: no end. liveness: s. run: of the `scenario` that has started it; its
    participants are then that run's, and what another run's nodes report is not for it. born: ns of the
    wall clock. listens: s during which it takes nobody, in which it hears of another coordinator. `poll`
    and `hear` return what is to be announced."""

    def __init__(
        self,
        participants: Iterable[str],
        factor: float = 1.0,
        duration: float = 0.0,
        liveness: float = 5.0,
        armed: bool = True,
        paused: bool = False,
        run: str = "",
        born: int = 0,
        listens: float = 0.0,
    ) -> None:
        self._run, self._born, self._listens = run, born, listens
        self.session = secrets.token_hex(4)
        self.participants = list(participants)
        self.pace = Pace(factor)
        self.state = WAITING
        self.stamp = ORIGIN
        self.ticks = self.repeats = 0
        self.members: dict[str, Member] = {}
        self._senders: dict[str, str] = {}  # name -> id of who has joined under it
        self.reason = ""
        self.armed, self._paused = armed, paused
        self._duration, self._liveness = duration, liveness
        self._schedule = Schedule([])
        self._tick: Tick | None = None
        self._hearing: set[str] = set()  # names that have answered the tick that asks nothing
        self._owing: set[str] = set()  # names that have not done what the tick asked
        self._sent: dict[str, int] = {}  # way -> newest stamp sent into the link, taken out of it
        self._taken: dict[str, int] = {}
        self._kept = Kept()
        self._lead = 0  # ns
        self._waits_for: dict[str, str] = {}  # name -> what it says it waits for
        self._heard: dict[str, float] = {}
        self._refused: dict[str, str] = {}
        self._lived = self._asked = self._granted = self._told = 0.0
        self._late_since: float | None = None  # since when a recorder is waited for
        self._last_wall: float | None = None
        self._stepping = False
        self._news = False

    # What is asked of it from outside.

    def pause(self) -> str | None:
        """Stops time before the next tick; None when done, else why not."""
        if self.state != RUNNING:
            return self._in_words
        self.state = PAUSED
        self.pace.stop()
        return None

    def resume(self) -> str | None:
        if self.state != PAUSED:
            return f"{self._in_words}, not paused"
        self.state = RUNNING
        return None

    def step(self) -> str | None:
        """One tick, while paused."""
        if self.state != PAUSED:
            return f"{self._in_words}; pause it before a step" if self.state == RUNNING else self._in_words
        if self._busy or self._stepping:
            return "the last step is not over yet"
        self._stepping = True
        return None

    def end(self, reason: str) -> Status:
        """No tick comes any more."""
        if self.state not in ENDED:
            self.state, self.reason = OVER, reason
        return self.status()

    def status(self) -> Status:
        reason = self.reason or self._missing()
        return Status(
            self.session,
            self.state,
            self.stamp,
            tuple(self.members),
            reason,
            dict(self._refused),
            round(self.pace.achieved, 3),
            tuple(self._senders.values()),
            self._run,
            self._born,
        )

    def yields_to(self, other: Status) -> bool:
        """Whether another coordinator goes on and this one does not: there is one time in a ROS domain, and
        the one that has begun, or else the one that was there first, has it."""
        if other.session == self.session or self.state in ENDED or other.state in ENDED:
            return False
        if (self.state in BEGUN) != (other.state in BEGUN):
            return other.state in BEGUN
        return (other.born, other.session) < (self._born, self.session)

    def give_way(self) -> Status:
        """To another coordinator: its participants turn to that one, or are halted where time has begun."""
        if self.state == WAITING:
            self.state = WITHDRAWN
        else:
            self._halt("another coordinator of simulated time, which was there first, goes on")
        return self.status()

    # Messages.

    def hear(self, report: Report, wall: float) -> None:
        """Takes what a participant says; `poll` then says what follows."""
        self._live(wall)
        if report.run not in ("", self._run):
            return
        name = report.name
        if report.act == "join" and report.member is not None:
            if self._lived >= self._listens:  # else it joins again
                self._join(report.member, report.sender, report.run)
            return
        if name not in self.members or self._senders[name] != report.sender:
            return
        self._heard[name] = self._lived
        member = self.members[name]
        if report.act == "recorded":
            self._kept.take(name, report.stamps)
        elif report.act == "taken" and member.kind == LINK:
            for way, stamp in report.stamps.items():
                if way in member.topics and stamp > self._taken.get(way, 0):
                    self._taken[way] = stamp
                    self._schedule.under_way(way, stamp, report.arrivals)
        elif report.act == "left":
            self._leave(member, report.what)
        elif self._tick is None:
            if report.act == "done" and report.what == self.session and name not in self._hearing:
                self._hearing.add(name)
                self._news = True
        elif report.number == self._tick.number:
            if report.act == "waiting":
                self._waits_for[name] = report.what
            elif report.act == "done":
                self._sent.update(report.stamps)
                if member.kind == PLANT:
                    self._schedule.silence(name, report.silent)
                self._owing.discard(name)

    def poll(self, wall: float) -> list[Tick | Status]:
        """What is to be announced now: the next tick, the last one again, or a status."""
        self._live(wall)
        before = self.state
        out = self._progress(wall)
        if self.state != before or self._news or self._lived - self._told >= HEARTBEAT:
            if self.state == WAITING and self._deaf():
                # Ticks have a topic of their own, which the middleware may find seconds after the others.
                out.append(Tick(self.session, 0, ORIGIN, ()))
            out.insert(0, self.status())  # whoever has just joined knows that before the tick that asks him
            self._news, self._told = False, self._lived
        return out

    # Within.

    @property
    def _in_words(self) -> str:
        reason = self.reason or self._missing()
        return f"time is {self.state}" + (f": {reason}" if reason else "")

    @property
    def _busy(self) -> bool:
        return bool(self._owing or self._link_owes())

    def _link_owes(self) -> list[str]:
        return [way for way, stamp in self._sent.items() if self._taken.get(way, 0) < stamp]

    def _live(self, wall: float) -> None:
        if self._last_wall is not None:
            self._lived += min(max(0.0, wall - self._last_wall), LONGEST_STEP)
        self._last_wall = wall

    def _progress(self, wall: float) -> list[Tick | Status]:
        if self.state == WAITING:
            if not self.armed or self._missing():
                return []
            self._schedule = Schedule(self.members.values(), self._duration)
            self._lead = longest_lead(self._schedule.samples_per_second)
            self.state = PAUSED if self._paused else RUNNING
            if self._schedule.next_stamp is None:
                self._halt("nobody takes part who publishes anything; put a plant among the nodes")
        if self.state in ENDED:
            return []
        if self._busy:
            return self._ask_again()
        if self.state == PAUSED and not self._stepping:
            return []
        following = self._schedule.next_stamp
        limit = ORIGIN - 1 if following is None else following - self._lead
        late = self._kept.late(self.members.values(), self._published, limit, all_of_it=following is None)
        if late:
            return self._await_recorders(late)
        self._late_since = None
        if following is None:
            self.state = OVER
            self.stamp = ORIGIN + round(self._duration * 1e9)
            return []
        if not self._stepping and self.pace.wait(wall, seconds(following)) > 0.0:
            return []
        self._stepping = False
        return [self._grant(wall)]

    def _grant(self, wall: float) -> Tick:
        grant = self._schedule.grant()
        self.ticks += 1
        self._tick = Tick(
            self.session, self.ticks, grant.stamp, grant.due, grant.states, grant.newest, grant.deliveries
        )
        self.stamp = grant.stamp
        self._owing = set(grant.due)
        if grant.states:
            self._owing |= {
                m.name for m in self.members.values()
                if m.linked and m.kind == ANSWERER and set(m.topics) & set(grant.states)
            }  # fmt: skip
        self._begin_waiting()
        if self.state == RUNNING:
            self.pace.advanced(wall, seconds(grant.stamp))
        return self._tick

    def _begin_waiting(self) -> None:
        self._waits_for.clear()
        self._asked = self._granted = self._lived
        self._heard = dict.fromkeys(self.members, self._lived)

    def _ask_again(self) -> list[Tick | Status]:
        if self._lived - self._asked < REPEAT or self._tick is None:
            return []
        self._judge()
        if self.state == HALTED:
            return []
        self._asked = self._lived
        self.repeats += 1
        return [self._tick]

    def _judge(self) -> None:
        """Halts where somebody owes something and is silent for too long, or all say they wait."""
        silent = {
            name for name in self._owed_by() if self._lived - self._heard.get(name, 0.0) > self._liveness
        }
        if not silent and self._lived - self._granted > STUCK * self._liveness:
            waiting = [f"{name} waits for {what}" for name, what in self._waits_for.items()]
            self._halt(f"the tick of {seconds(self.stamp):.4f} s does not end: {'; '.join(waiting)}")
        elif silent:
            self._halt("; ".join(self._accusation(name, self._liveness) for name in sorted(silent)))

    def _owed_by(self) -> set[str]:
        """Who keeps time from going on, as far as one knows: what waits for an answer owes nothing itself."""
        owed = set(self._owing)
        if self._link_owes():
            owed |= {m.name for m in self.members.values() if m.kind == LINK}
        for name in list(owed):
            if self._waits_for.get(name) == "answer":
                topic = self.members[name].topic
                owed |= {m.name for m in self.members.values() if topic in m.topics and m.kind == ANSWERER}
        return owed

    def _accusation(self, name: str, silence: float) -> str:
        member = self.members[name]
        when = f"of {seconds(self.stamp):.4f} s"
        what = {
            PLANT: f"its state on {member.topic} {when}, or the step after the answer",
            SOURCE: f"its sample on {member.topic} {when}",
            ANSWERER: f"the answer to the state on {' and '.join(self._states())} {when}",
            LINK: f"word of the packets {when}",
            RECORDER: f"word that it has kept what was published up to {when[3:]}",
        }[member.kind]
        return f"{name} owes {what} and has been silent for {silence:g} s"

    def _states(self) -> tuple[str, ...]:
        return self._tick.states if self._tick is not None else ()

    def _published(self) -> dict[str, int]:
        """Topic -> newest stamp on it, ns: of states, of the commands that answer them, of the link's."""
        published = self._schedule.last_stamps()
        for member in self.members.values():
            if member.kind == PLANT and member.topic in published and member.topic in self._schedule.answered:
                published[member.commands] = published[member.topic]
        return published | self._sent

    def _await_recorders(self, late: list[str]) -> list[Tick | Status]:
        """They answer a status with what they have kept."""
        patience = max(RECORDER_LIVENESS, self._liveness)
        if self._late_since is None:
            self._late_since = self._lived
        if self._lived - self._late_since > STUCK * patience:
            kept = self._kept.of(late)
            self._halt(f"what was published up to {seconds(self.stamp):.4f} s is not recorded: {kept}")
            return []
        for name in late:
            if self._lived - self._heard.get(name, 0.0) > patience:
                self._halt(self._accusation(name, patience))
                return []
        if self._lived - self._asked < REPEAT:
            return []
        self._asked = self._lived
        self.repeats += 1
        # Said again, what was said last makes the middleware deliver what is missing before it.
        return [self.status(), *([self._tick] if self._tick is not None else [])]

    def _halt(self, reason: str) -> None:
        self.state, self.reason = HALTED, reason
        self.pace.stop()

    def _join(self, member: Member, sender: str, run: str) -> None:
        self._news = True
        if refusal := self._refusal(member, sender, run):
            self._refused[sender] = refusal
            return
        self._refused.pop(sender, None)
        if self._senders.get(member.name) != sender:
            self._hearing.discard(member.name)
        self.members[member.name], self._senders[member.name] = member, sender
        self._kept.look_again()
        self._heard[member.name] = self._lived

    def _refusal(self, member: Member, sender: str, run: str) -> str:
        """Why it may not take part; else empty."""
        known = self._senders.get(member.name)
        if member.name in self._deaf() and self._lived - self._heard[member.name] > self._liveness:
            known = None  # it has not been heard of since it joined: whoever comes now takes its place
        if (known is not None and known != sender) or (run != self._run and self._expects(member.name)):
            return "another node of this name takes part; stop one of them, or give it another name"
        if known is None and self.state != WAITING and member.kind != RECORDER:
            return "simulated time runs already; start it before, or start all anew"
        if member.kind in (PLANT, SOURCE) and any(
            other.topic == member.topic and other.name != member.name for other in self.members.values()
        ):
            return f"another node publishes {member.topic}; stop one of them"
        return ""

    def _expects(self, name: str) -> bool:
        return name in self.participants or name.rsplit("/", 1)[-1] in self.participants

    def _leave(self, member: Member, why: str) -> None:
        del self.members[member.name], self._senders[member.name]
        self._hearing.discard(member.name)
        if self.state in BEGUN and member.kind != RECORDER:
            self._halt(f"{member.name} {why or 'has ended'}")
        self._owing.discard(member.name)

    def _missing(self) -> str:
        """What is waited for before time begins, in words."""
        if self.state != WAITING:
            return ""
        there = [*self.members, *(name.rsplit("/", 1)[-1] for name in self.members)]
        missing = [name for name in self.participants if name not in there]
        if missing:
            return f"waiting for {', '.join(missing)} to take part (each with use_sim_time: true)"
        if deaf := self._deaf():
            return f"waiting for {', '.join(deaf)} to hear ticks"
        return "" if self.armed else "waiting for the start"

    def _deaf(self) -> list[str]:
        """Who has joined, and has not yet shown that ticks reach it; a recorder hears none."""
        return [m.name for m in self.members.values() if m.kind != RECORDER and m.name not in self._hearing]
