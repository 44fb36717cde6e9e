"""An `unknown` of a rigid joint that is no torque but an error of its encoder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.records import Record

from ...evidence.proof import Course
from ...evidence.reading_error import ReadingError, reading_error
from ...evidence.true_readings import Corrected, with_true_readings
from ..name_tests.place import effect_of
from ..verdict import Verdict


class WrongReading(NamedTuple):
    """The error of an encoder, and what a correction by it is worth."""

    error: ReadingError
    worth: Corrected

    def content(self) -> dict[str, Any]:
        """What diagnosis.json says."""
        return self.error.content(self.worth.content())


def read_wrong(
    verdict: Verdict,
    baseline: Fit,
    kinds: tuple[Sequence[Record], Sequence[Record]],
    cutoff: float,
    course: Course,
    count: int,
) -> tuple[Verdict, WrongReading | None]:
    """The `unknown` verdict at the encoder, where its error over the angle is what is missing and with
    corrected readings the validation recordings are simulated better; and that error. ``kinds``: recordings
    of the estimation and of the validation; ``course``, ``count``: see `with_true_readings`."""
    if verdict.kind != "unknown":
        return verdict, None
    named = [effect_of(f) for f in verdict.findings]
    error = reading_error(baseline.model, named, *kinds, cutoff)
    if error is None:
        return verdict, None
    worth = with_true_readings(error, baseline, named, kinds[0], course, count)
    if worth is None or worth.corrected <= worth.as_read:
        return verdict, None
    return _at_the_encoder(verdict, error), WrongReading(error, worth)


def _at_the_encoder(verdict: Verdict, error: ReadingError) -> Verdict:
    told, *others = verdict.where or [{}]
    where = {
        **told,
        "equation": error.location,
        "share": round(error.explained, 3),
        "condition": "motor angle",
        "intervals": [],
    }
    return replace(verdict, where=[where, *others])
