"""How long the machine itself stands still while a test runs that is about the machine's clock.

An ordinary virtual machine stops for 50 to 80 ms now and then, and for 300 ms sometimes. A bound in wall time
says something of the program only where the machine kept out of it.
"""

from __future__ import annotations

import subprocess
import sys
import warnings
from pathlib import Path
from types import TracebackType
from typing import Self

WATCH = """
import time
worst, last = 0.0, time.monotonic()
while True:
    time.sleep(0.001)
    now = time.monotonic()
    if now - last - 0.001 > worst:
        worst = now - last - 0.001
        print(worst, flush=True)
    last = now
"""

SHARE = 0.1
"""Of a bound: where a process that only sleeps was late by this much, one that works, or a chain of them,
may have been late by all of it."""


class Stalls:
    """A process beside the test that sleeps for a millisecond at a time; a context manager.

    worst: by how much it woke too late at most so far, s.
    """

    def __init__(self, folder: Path) -> None:
        self._file = folder / "stalls.txt"

    def __enter__(self) -> Self:
        with self._file.open("w") as out:
            self._process = subprocess.Popen([sys.executable, "-S", "-c", WATCH], stdout=out)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.kill()
        self._process.wait()

    @property
    def worst(self) -> float:
        lines = self._file.read_text().split("\n")[:-1]
        return float(lines[-1]) if lines else 0.0

    def excuse(self, bound: float) -> bool:
        """Whether the machine was too late for a program to be judged by `bound`, s; then a warning says
        so."""
        excused = self.worst > SHARE * bound
        if excused:
            warnings.warn(
                f"not judged by its bound of {bound:g} s: the machine kept a sleeping process waiting for "
                f"{self.worst:.3f} s",
                stacklevel=2,
            )
        return excused
