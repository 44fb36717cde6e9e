"""What the computer did to the rate of a recording, apart from what the robots did.

One line for each thing that only the machine is to blame for: here it is the samples that came late or
never. A run on simulated time has none of that; how fast its time went would be told here, as a line of its
own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from haptic_teleop_control.recording.said import Status
from haptic_teleop_sysid.report.page import Status as Colour

LOST_SHARE = 0.001
SKIPPED = "periods skipped"
"""The name under which a node's diagnostics count the periods that began too late to be kept."""


@dataclass(frozen=True)
class Machine:
    """missing: samples that the rates would have had and the recording lacks, of `expected`.
    lost_on_the_way: of these, by the recorder's count, or None where it did not tell; the others were never
    taken. skipped: periods that the nodes say they skipped, or None where no node does. late_percent: of the
    answers to the slave, that took more than two periods; None where nothing is answered."""

    expected: int = 0
    missing: int = 0
    lost_on_the_way: int | None = None
    skipped: int | None = None
    late_percent: float | None = None

    @property
    def missing_percent(self) -> float:
        """Of all samples that there should be."""
        return 100.0 * self.missing / max(1, self.expected)

    def as_json(self) -> dict[str, Any]:
        """As plain data."""
        return asdict(self) | {"missing_percent": self.missing_percent}

    def lines(self) -> list[tuple[Colour, str]]:
        """(status, sentence) each."""
        late = None if self.late_percent is None else f"{self.late_percent:.2g} % of the answers came late"
        if not self.missing and not self.lost_on_the_way:
            parts = ["it kept the rate: no sample is missing"]
        else:
            what = f"{self.missing} of {self.expected} samples are missing ({self.missing_percent:.2g} %)"
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


def read_machine(graph: Mapping[str, Any], diagnostics: Sequence[Status]) -> Machine:
    """Return what `graph` (see `timing.graph_health`) and the nodes' diagnostics tell of it."""
    topics = list(graph["topics"].values())
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
    )
