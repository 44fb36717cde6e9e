"""About how long a diagnosis takes, from what its first steps took on this machine, with these recordings."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

#: What follows costs in times of what the re-estimation of the given structure takes: a round of the search,
#: the search by free simulation, and all that comes after both. Measured with tests/benchmarks/diagnosis.py.
ROUND, FREELY, REST = 8.0, 8.0, 3.0
#: What a step that takes longer than thought is taken to need in all, in times of what it has taken so far.
_LONGER = 1.2
_ROUND = re.compile(r"effect (\d+): ")
_REST = ("doubting", "deciding", "simulating", "choosing", "writing")


@dataclass
class DiagnosisForecast:
    """A `Forecast` that follows the steps `diagnose` tells of. ``nulls``: how many diagnoses without effect
    follow for each of the ``cores``.

    Nobody knows beforehand how many effects there are, so one more round is never counted before it begins.
    """

    nulls: int = 0
    cores: int = 1
    _began: list[tuple[str, float]] = field(default_factory=list)

    def step(self, text: str, elapsed: float) -> None:
        """A step begins; those of one phase are told apart by nobody here."""
        phase = _phase(text)
        if phase is not None and (not self._began or self._began[-1][0] != phase):
            self._began.append((phase, elapsed))

    def total(self, elapsed: float) -> float | None:
        """About how long it takes in all, s; None before the structure was re-estimated."""
        took = {
            phase: end - begin
            for (phase, begin), (_, end) in zip(
                self._began, [*self._began[1:], ("", elapsed)], strict=True
            )
        }
        if "baseline" not in took or self._began[-1][0] == "baseline":
            return None
        phase, since = self._began[-1]
        unit = took["baseline"]
        rounds = [t for p, t in took.items() if p.startswith("round") and p != phase]
        one_round = rounds[-1] if rounds else ROUND * unit
        null = self.nulls / self.cores * (unit + one_round + REST * unit)
        thought = {"free": FREELY * unit, "nulls": null, "rest": REST * unit}.get(phase, one_round)
        spent = elapsed - since
        to_come = 0.0 if phase == "rest" else REST * unit
        to_come += null if self.nulls and phase not in ("nulls", "rest") else 0.0
        return since + max(thought, _LONGER * spent) + to_come


def _phase(text: str) -> str | None:
    """The phase that a step belongs to; None for that of the step before."""
    if text.startswith("reading"):
        return "reading"
    if "freely running" in text or text == "searching by free simulation":
        return "free"
    if text.startswith("re-estimating"):
        return "baseline"
    if text.startswith("the same search on"):
        return "nulls"
    found = _ROUND.match(text)
    if found is not None:
        return f"round {found.group(1)}"
    return "rest" if text.startswith(_REST) else None
