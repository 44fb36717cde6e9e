"""Who was heard of when: the states of both robots, the artificial command, and both ways of the link."""

from __future__ import annotations

from haptic_teleop_control.teleoperation.faults import STALE_LINK, STALE_MASTER, STALE_REFERENCE, STALE_SLAVE

AGE_MEMORY = 0.02
"""Weight of a new sample in the mean age of what the link brings, once there were enough of them."""


class Stream:
    """at: ns at which something was last heard, None before the first sample and after `forget`. fault: what
    it is when it goes silent. age: s, mean age by the stamps of what it brings. refused: what was wrong with
    the samples that came instead of good ones."""

    __slots__ = ("_count", "age", "at", "fault", "name", "refused")

    def __init__(self, name: str, fault: str) -> None:
        self.name, self.fault = name, fault
        self.at: int | None = None
        self.age = 0.0
        self.refused = ""
        self._count = 0

    def hear(self, now: int, age: float) -> None:
        """A sample that is `age` s old has arrived."""
        count = 0 if self.at is None else self._count
        self._count = count + 1
        mean = self.age if count else 0.0
        self.age = mean + max(AGE_MEMORY, 1.0 / self._count) * (age - mean)
        self.at = now

    def silence(self, now: int) -> float:
        """s since the last sample; infinite before the first."""
        return float("inf") if self.at is None else (now - self.at) * 1e-9


class Streams:
    """All that the coupling listens to. timeout: ns.

    In reference mode (`from_reference`) nobody needs the master's device; but once it is there, it may not go
    silent.
    """

    def __init__(self, master: str, slave: str, from_reference: bool, linked: bool, timeout: int) -> None:
        self.timeout = timeout
        self.reference = Stream("reference", STALE_REFERENCE)
        self.master = Stream(f"{master}/joint_states", STALE_MASTER)
        self.slave = Stream(f"{slave}/joint_states", STALE_SLAVE)
        self.forward = Stream("the link to the slave", STALE_LINK)
        self.backward = Stream("the link to the master", STALE_LINK)
        commands = self.reference if from_reference else self.master
        ways = (self.forward, self.backward) if linked else ()
        self._linked = linked
        self._required = (self.slave, commands, *ways)
        self._watched = (self.slave, self.master, self.reference, *ways)
        if not from_reference:
            self._watched = (self.slave, self.master, *ways)

    def missing(self, now: int) -> Stream | None:
        """The first that is needed and was never heard of or is too old."""
        for stream in self._required:
            if stream.at is None or now - stream.at > self.timeout:
                return stream
        return None

    def silent(self, now: int) -> Stream | None:
        """The first that was heard of and is too old."""
        for stream in self._watched:
            if stream.at is not None and now - stream.at > self.timeout:
                return stream
        return None

    def forget(self) -> None:
        """As if nothing had been heard yet."""
        for stream in (self.reference, self.master, self.slave, self.forward, self.backward):
            stream.at = None

    @property
    def round_trip(self) -> float:
        """s, mean age of what the slave hears of the master and the master of the slave, together. Added, the
        two ages do not depend on how the clocks at both ends agree."""
        return self.forward.age + self.backward.age if self._linked else 0.0
