"""What was said against what was hidden, in one word and one sentence; scored as in the blind benchmark."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from haptic_teleop_sysid.blind.scoring import read_diagnosis, score_case

Outcome = Literal["right", "in the set", "right place", "unknown", "missed", "wrong", "failed"]
_SENTENCES: dict[Outcome, str] = {
    "right": "the first finding is what was hidden, by name and place",
    "in the set": "what was hidden is among the stated explanations, but not the first",
    "right place": "the place is right, the name is not",
    "unknown": "it was said that something unknown is missing, and no name was given",
    "missed": "no mismatch was found, although one was hidden",
    "wrong": "the place is wrong, whatever the name",
    "failed": "the diagnosis reached no verdict",
}


@dataclass(frozen=True)
class Judgement:
    """outcome: one of `Outcome`; sentence: the same in words. beside: findings that were not hidden, as
    "effect @ location". parameters: of the hidden effect, with truth, value and relative error, when its name
    is right. diagnosis: the content of diagnosis.json. score: the blind benchmark's.
    """

    outcome: Outcome
    beside: list[str]
    parameters: list[dict[str, Any]]
    diagnosis: dict[str, Any]
    score: dict[str, Any]

    @property
    def right(self) -> bool:
        """Whether the first name is the hidden one, at its place."""
        return self.outcome == "right"

    @property
    def sentence(self) -> str:
        """The outcome in words."""
        return _SENTENCES[self.outcome]


def judge(label: dict[str, Any], case: Path) -> Judgement:
    """Return how the diagnosis in the directory `case` does against the opened `label`."""
    diagnosis = read_diagnosis(case)
    score = score_case(case.name, label, case)
    truth = f"{label['truth'][0]['effect']} @ {label['truth'][0]['location']}"
    return Judgement(
        outcome=_outcome(truth, score),
        beside=[said for said in score["said"] if said != truth],
        parameters=score["parameters"],
        diagnosis=diagnosis,
        score=score,
    )


def _outcome(truth: str, score: dict[str, Any]) -> Outcome:
    if score["verdict"] == "failed":
        return "failed"
    if score["verdict"] == "no_mismatch":
        return "missed"
    # A verdict may be ambiguous about a second finding while the first is plain.
    if score["said"][:1] == [truth]:
        return "right"
    if truth in score["said"] or truth in score["stated"]:
        return "in the set"
    if score["verdict"] == "unknown" and not score["said"]:
        return "unknown"
    return "right place" if score["place"] == truth.rsplit(" @ ", 1)[1] else "wrong"
