"""An `unknown` of a rigid joint that is no torque but an error of its encoder."""

from __future__ import annotations

from dataclasses import replace

from ..evidence.reading_error import ReadingError
from .verdict import Verdict


def read_wrong(verdict: Verdict, error: ReadingError) -> tuple[Verdict, str]:
    """The verdict at the encoder, where it follows the angle; and that place."""
    told, *others = verdict.where or [{"intervals": []}]
    where = {
        **told,
        "equation": error.location,
        "share": round(error.explained, 3),
        "condition": "motor angle",
        "intervals": [],
    }
    return replace(verdict, where=[where, *others]), error.location
