"""Faults that are counted, named and latched.

Per-sample code never raises: it counts a fault here and goes on with a safe output. The first fault stays
latched until somebody resets it, because it is the cause and the ones after it are usually consequences.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

NON_FINITE_COMMAND = "non_finite_command"
STALE_COMMAND = "stale_command"
MALFORMED_COMMAND = "malformed_command"
FUTURE_COMMAND = "future_command"
CONTRADICTORY_COMMAND = "contradictory_command"
UNCOORDINATED_COMMAND = "uncoordinated_command"
SECOND_SENDER = "second_sender"

SECOND_SENDER_SENTENCE = (
    "two publishers send on one topic, and only the first is heard; stop one of them, or give it another "
    "ROS_DOMAIN_ID"
)

COMMAND_FAULTS: dict[str, str] = {
    NON_FINITE_COMMAND: "a command held a value that is not a finite number; look at its publisher",
    MALFORMED_COMMAND: "a command had the wrong number of values or wrong joint names; look at its publisher",
    STALE_COMMAND: "the last command is too old; look whether its publisher still runs and keeps its rate",
    FUTURE_COMMAND: "a command answers a state that there has not been yet; look at its publisher's stamps",
    CONTRADICTORY_COMMAND: "one state was answered twice with different values; look for a second publisher",
    UNCOORDINATED_COMMAND: (
        "a command came from a node that takes no part in simulated time, so that nobody waits for it; let "
        "all nodes go by the wall (use_sim_time: false)"
    ),
    SECOND_SENDER: SECOND_SENDER_SENTENCE,
}
"""Faults of a received command, with the sentence for the log."""


class FaultLatch:
    """Counts faults by name; the first one latches until `reset`.

    names: the names allowed, or a mapping from name to a sentence that says what happened and what to do.
    """

    def __init__(self, names: Iterable[str] | Mapping[str, str]) -> None:
        self._sentences = dict(names) if isinstance(names, Mapping) else dict.fromkeys(names, "")
        self._counts = dict.fromkeys(self._sentences, 0)
        self._latched: str | None = None
        self._detail = ""

    def count(self, name: str, detail: str = "") -> bool:
        """One more fault `name`; True when it is the one that latches now, which is the moment to log it.

        Raises KeyError for a name that was not declared: that is a mistake in the program, not a fault.
        """
        self._counts[name] += 1
        if self._latched is not None:
            return False
        self._latched, self._detail = name, detail
        return True

    @property
    def latched(self) -> str | None:
        """Name of the first fault since the last reset, or None."""
        return self._latched

    @property
    def detail(self) -> str:
        """What was said with the latched fault."""
        return self._detail

    @property
    def counts(self) -> dict[str, int]:
        """Faults since the start, by name; a reset does not forget them."""
        return dict(self._counts)

    @property
    def total(self) -> int:
        """All faults since the start."""
        return sum(self._counts.values())

    @property
    def sentence(self) -> str | None:
        """The latched fault for people: its name, what happened, what to do, the detail; or None."""
        if self._latched is None:
            return None
        return self.describe(self._latched, self._detail)

    def describe(self, name: str, detail: str = "") -> str:
        """The sentence of one fault."""
        text = self._sentences[name]
        return f"{name}{': ' + text if text else ''}{' (' + detail + ')' if detail else ''}."

    def reset(self) -> str | None:
        """Unlatch; returns the name that was latched, or None."""
        released, self._latched, self._detail = self._latched, None, ""
        return released
