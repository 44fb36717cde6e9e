"""One thing that `doctor` looked at: how it is, and what to do where it is not as it should be."""

from __future__ import annotations

from dataclasses import dataclass

OK, ABSENT, SLOW, BAD = "ok", "absent", "slow", "bad"
"""ABSENT: only hardware needs it; SLOW: good enough for everything but hardware."""


@dataclass(frozen=True)
class Check:
    """level: OK, ABSENT, SLOW or BAD. finding: what is there. remedy: what to do; empty when OK."""

    subject: str
    level: str
    finding: str
    remedy: str = ""

    @property
    def line(self) -> str:
        """For the terminal."""
        mark = {OK: "OK      ", ABSENT: "absent  ", SLOW: "slow    ", BAD: "PROBLEM "}[self.level]
        return f"{mark} {self.subject}: {self.finding}" + (f"; {self.remedy}" if self.remedy else "")
