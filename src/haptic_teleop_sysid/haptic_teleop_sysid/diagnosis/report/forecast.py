"""About how long a diagnosis takes, from what one pass over these recordings takes on this machine."""

from __future__ import annotations

import re
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.prediction_fit import normal_equations
from haptic_teleop_sysid.estimation.records import Record, thinned_to
from haptic_teleop_sysid.estimation.tuning import initial_noise

#: Passes (one gradient over the thinned recordings) that the phases of a diagnosis take: the re-estimation of
#: the given structure, a round of the search, the search by free simulation, and what comes after: in the
#: middle of nine diagnoses of simulated and real recordings. Rounds took 0.1 to 2.8 times as many, what comes
#: after 0.3 to 1.6 times, and a search by free simulation up to 30 times.
BASELINE, ROUND, FREELY, REST = 600.0, 3900.0, 3000.0, 3900.0
#: What a phase that takes longer than thought is taken to need in all, in times of what it has taken so far.
_LONGER = 1.2
_ROUND = re.compile(r"effect (\d+): ")
_REST = ("checking", "deciding", "simulating", "choosing", "writing")


def pass_seconds(model: Model, records: Sequence[Record]) -> float | None:
    """Seconds of one gradient over the records, thinned as the search does it; None where the model predicts
    nothing. The first pass, which may have to compile, is not counted."""
    few = thinned_to(records)
    took = 0.0
    try:
        noise = initial_noise(pack(model), few)
        for _ in range(2):
            began = time.perf_counter()
            normal_equations(model, noise, few, model.free_parameters())
            took = time.perf_counter() - began
    except (np.linalg.LinAlgError, ValueError):
        return None
    return took


@dataclass
class DiagnosisForecast:
    """A `Forecast` that follows the steps `diagnose` tells of. ``unit``: s of a pass, see `pass_seconds`;
    ``nulls``: how many diagnoses without effect come at the end, over so many ``cores``.

    Nobody knows beforehand how many effects there are: a further round is not counted before it begins.
    """

    nulls: int = 0
    cores: int = 1
    unit: float | None = None
    _began: list[tuple[str, float]] = field(default_factory=list)

    def step(self, text: str, elapsed: float) -> None:
        """A step begins; within a phase they are not told apart."""
        phase = _phase(text)
        if phase is not None and (not self._began or self._began[-1][0] != phase):
            self._began.append((phase, elapsed))

    @property
    def may_grow(self) -> bool:
        """Whether a further effect, or a search by free simulation, may still come or takes its time."""
        return not self._began or self._began[-1][0] not in ("nulls", "rest")

    def total(self, elapsed: float) -> float | None:
        """About how long it takes in all, s; None before a pass was measured."""
        if self.unit is None or not self._began:
            return None
        unit, (phase, since) = self.unit, self._began[-1]
        ends = [when for _, when in self._began[1:]]
        rounds = [
            end - begin
            for (name, begin), end in zip(self._began, ends, strict=False)
            if name.startswith("round")
        ]
        # Other work on the machine, and steps that converge slowly, show in the rounds so far.
        pace = sum(rounds) / (len(rounds) * ROUND * unit) if rounds else 1.0
        one_round = rounds[-1] if rounds else ROUND * unit
        rest = REST * unit * pace
        null = self.nulls / self.cores * (BASELINE * unit * pace + one_round + rest)
        thought = {"reading": 0.0, "baseline": BASELINE * unit, "free": FREELY * unit * pace}
        thought |= {"nulls": null, "rest": rest}
        to_come = 0.0 if phase == "rest" else rest
        to_come += one_round if phase in ("reading", "baseline") else 0.0
        to_come += null if phase not in ("nulls", "rest") else 0.0
        return since + max(thought.get(phase, one_round), _LONGER * (elapsed - since)) + to_come


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
