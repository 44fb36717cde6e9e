"""The verdict on a search, in the terms of diagnosis.json."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from haptic_teleop_sysid.estimation.records import Record

from ..evidence.residual import Condition, conditions
from ..policy import SUREST
from .adequacy import Adequacy
from .corroborated import adds_torque
from .finding import finding
from .reasons import Doubt
from .search.rounds import SearchResult
from .where import doubtful_place, structured, where_found, where_left


@dataclass(frozen=True)
class Verdict:
    """``kind``: identified | ambiguous | unknown | no_mismatch; ``where``, ``findings``: as in
    diagnosis.json;
    ``remaining``: what the left-over torque still depends on, strongest first; ``before``: the same of the
    baseline; ``adequacy``: how much of what is missing the findings explain, None where none was asked."""

    kind: str
    where: list[dict[str, Any]]
    findings: list[dict[str, Any]]
    remaining: list[Condition]
    before: list[Condition]
    adequacy: Adequacy | None = None


def decide_verdict(
    result: SearchResult,
    estimation: Sequence[Record],
    validation: Sequence[Record],
    doubt: Doubt | None = None,
    spread: dict[str, float] | None = None,
    adequate: Adequacy | None = None,
) -> Verdict:
    """The verdict on a search; ``doubt``: what speaks against the names found, or for something unnamed;
    ``spread``: by what parameters differ between recordings (`Stand`) and forms of a law; ``adequate``: how
    much of what is missing the findings explain, None where that was not asked."""
    joint = result.baseline.model.joint
    before = conditions(result.baseline, estimation, validation, joint)
    remaining = conditions(result.final, estimation, validation, joint) if result.choices else before
    surest = SUREST if adequate is None else adequate.surest
    own = result.baseline.model
    findings = [finding(c, result.final, spread or {}, surest, own) for c in result.choices]
    unexplained = structured(result.final, remaining, estimation, result)
    if result.choices and adequate is not None and (adequate.much_is_left or adequate.worse):
        # Beside something unknown an error of an encoder has to show in free runs; a torque has the torques.
        beside = [
            f
            for c, f in zip(result.choices, findings, strict=True)
            if f["confidence"] > 0.0 or adds_torque(c.chosen.effect)
        ]
        left = [where_left(result, remaining, estimation)]
        if adequate.follows is not None:
            left[0] |= {"equation": adequate.follows.equation, "condition": adequate.follows.quantity}
        where = left if adequate.much_is_left else where_found(result, before, estimation, None)
        return Verdict("unknown", where, beside, remaining, before, adequate)
    if result.choices:
        kind = "ambiguous" if any(c.ambiguous for c in result.choices) else "identified"
    else:
        kind = "unknown" if unexplained is not None or doubt is not None else "no_mismatch"
    where = where_found(result, before, estimation, unexplained if kind == "unknown" else None)
    if doubt is not None and not where:
        where = [doubtful_place(doubt, result, before, estimation)]
    return Verdict(kind, where, findings, remaining, before, adequate)
