"""What the computer did to the rate of a recording, apart from what the robots did.

One line for each thing that only the machine is to blame for: here it is the samples that came late or
never. Simulated time waits for every sample: there it is how fast time went.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from haptic_teleop_control.recording.said import Status
from haptic_teleop_sysid.report.page import Status as Colour
from haptic_teleop_sysid.verification.clock import LOCKSTEP, Clock

LOST_SHARE = 0.001
SKIPPED = "periods skipped"
"""The name under which a node's diagnostics count the periods that began too late to be kept."""
LINK = "/link/"
"""Beginning of the topics that come out of the emulated network, which loses what it is told to lose."""


@dataclass(frozen=True)
class Machine:
    """missing: samples that the rates would have had and the recording lacks, of `expected`.
    lost_on_the_way: of these, by the recorder's count, or None where it did not tell; the others were never
    taken. skipped: periods that the nodes say they skipped, or None where no node does. late_percent: of the
    answers to the slave, that took more than two periods; None where nothing tells. clock: by what time it
    ran."""

    expected: int = 0
    missing: int = 0
    lost_on_the_way: int | None = None
    skipped: int | None = None
    late_percent: float | None = None
    clock: Clock = field(default_factory=Clock)

    @property
    def missing_percent(self) -> float:
        """Of all samples that there should be."""
        return 100.0 * self.missing / max(1, self.expected)

    def as_json(self) -> dict[str, Any]:
        """As plain data."""
        return asdict(self) | {"missing_percent": self.missing_percent}

    def lines(self) -> list[tuple[Colour, str]]:
        """(status, sentence) each."""
        if not self.clock.of_wall:
            return [self._without_wall()]
        late = None if self.late_percent is None else f"{self.late_percent:.2g} % of the answers came late"
        if not self.missing and not self.lost_on_the_way:
            parts = ["it kept the rate: no sample is missing"]
        else:
            what = self._missing()
            if self.lost_on_the_way is None:
                what += ", never taken or lost on the way"
            else:
                never = max(0, self.missing - self.lost_on_the_way)
                what += f": {never} never taken because it was late, {self.lost_on_the_way} lost on the way"
            parts = [what]
        if self.skipped:
            parts.append(f"its nodes skipped {self.skipped} periods")
        if late is not None and self.late_percent:
            parts.append(late)
        share = self.missing_percent / 100.0
        status: Colour = "good" if share == 0.0 else ("fair" if share <= LOST_SHARE else "bad")
        return [(status, f"The computer, not the robots: {'; '.join(parts)}.")]

    def _without_wall(self) -> tuple[Colour, str]:
        """Nothing is ever late there, so that a sample that is missing is a defect."""
        what = "Lockstep, without a clock" if self.clock.kind == LOCKSTEP else "Simulated time"
        parts = [self._missing() if self.missing else "no sample is missing"]
        if self.lost_on_the_way:
            parts.append(f"{self.lost_on_the_way} were lost on the way to the recorder")
        if pace := self.clock.pace():
            parts.append(pace)
        return ("bad" if self.missing else "good", f"{what}: {'; '.join(parts)}.")

    def _missing(self) -> str:
        return f"{self.missing} of {self.expected} samples are missing ({self.missing_percent:.2g} %)"


def read_machine(graph: Mapping[str, Any], diagnostics: Sequence[Status], clock: Clock) -> Machine:
    """Return what `graph` (see `timing.graph_health`) and the nodes' diagnostics tell of it. clock: by what
    time it ran."""
    topics = [one for name, one in graph["topics"].items() if not name.startswith(LINK)]
    missing = sum(one["lost"] for one in topics)
    ways = [one["lost_on_the_way"] for one in topics]
    skipped: dict[str, int] = {}
    for status in diagnostics:
        told = status.values.get(SKIPPED, "").strip()
        if told.isdecimal():
            skipped[status.node] = int(told)
    return Machine(
        expected=missing + sum(one["messages"] for one in topics),
        missing=missing,
        lost_on_the_way=sum(ways) if ways and None not in ways else None,
        skipped=sum(skipped.values()) if skipped else None,
        late_percent=graph["latency"][0]["late_percent"] if graph["latency"] else None,
        clock=clock,
    )
