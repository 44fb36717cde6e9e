"""One thing that `doctor` looked at: how it is, and what to do where it is not as it should be."""

from __future__ import annotations

from dataclasses import dataclass

OK, ABSENT, SLOW, OPEN, BAD = "ok", "absent", "slow", "open", "bad"
"""ABSENT: only hardware needs it. SLOW: good enough for everything but hardware. OPEN: others may take part,
which endangers nobody where nothing real moves."""
HARDWARE_ONLY = (ABSENT, SLOW, OPEN)


@dataclass(frozen=True)
class Check:
    """level: one of those above. finding: what is there. remedy: what to do; empty when OK."""

    subject: str
    level: str
    finding: str
    remedy: str = ""

    @property
    def line(self) -> str:
        """For the terminal."""
        mark = f"{ {OK: 'OK', BAD: 'PROBLEM'}.get(self.level, self.level):8}"
        return f"{mark} {self.subject}: {self.finding}" + (f"; {self.remedy}" if self.remedy else "")
