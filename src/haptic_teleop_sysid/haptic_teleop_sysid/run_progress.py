"""How far a long run is: a live status on a terminal, a line now and then elsewhere, with the time that has
passed and, as soon as it can be told, about how long it takes in all."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from types import TracebackType
from typing import Any, Protocol

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.text import Text

from haptic_teleop_sysid.report.terminal import say

#: Seconds between two lines, during the first minute and from then on; and of the status on a terminal.
OFTEN, SELDOM, LIVE = 10.0, 30.0, 1.0
_FIRST_MINUTE = 60.0


class Forecast(Protocol):
    """What knows from the steps so far how long a run takes; times in s since it began."""

    def step(self, text: str, elapsed: float) -> None:
        """A step begins."""

    def total(self, elapsed: float) -> float | None:
        """About how long it takes in all; None while nobody can know."""

    @property
    def may_grow(self) -> bool:
        """Whether it may take longer, by what is found meanwhile."""
        ...


class RunProgress:
    """A context that tells of a run's steps on a console, from a thread of its own, so that a long step is
    told of, too. ``name``: what the lines begin with; ``clock``: s, monotonic."""

    def __init__(
        self, console: Console, name: str, forecast: Forecast, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._console, self._name, self._forecast, self._clock = console, name, forecast, clock
        self._began, self._text = clock(), ""
        self._ended, self._lock = threading.Event(), threading.Lock()
        self._status: Any = console.status(name) if console.is_terminal else nullcontext()
        self._thread = threading.Thread(target=self._tell, name=f"{name} progress", daemon=True)

    def __enter__(self) -> RunProgress:
        self._status.__enter__()
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ended.set()
        self._thread.join()
        self._status.__exit__(kind, error, trace)

    def say(self, text: str) -> None:
        """What is done from now on."""
        with self._lock:
            self._text = text
            self._forecast.step(text, self._clock() - self._began)

    def line(self) -> str:
        """What is told now."""
        with self._lock:
            elapsed = self._clock() - self._began
            total, text = self._forecast.total(elapsed), self._text
        about = "" if total is None else f" of about {in_minutes(total)}"
        more = " or more" if about and self._forecast.may_grow else ""
        return f"{self._name}: {in_minutes(elapsed)}{about} min{more}: {text}"

    def _tell(self) -> None:
        while not self._ended.wait(self._pause()):
            if self._console.is_terminal:
                self._status.update(Text(self.line()))
            else:
                say(self._console, self.line())

    def _pause(self) -> float:
        if self._console.is_terminal:
            return LIVE
        return OFTEN if self._clock() - self._began < _FIRST_MINUTE else SELDOM


class _Share:
    """Expects the rest to go at the pace of what is done."""

    done = 0.0
    may_grow = False

    def step(self, text: str, elapsed: float) -> None:
        """What is done is told by `done`."""

    def total(self, elapsed: float) -> float | None:
        """Nothing can be known of what has not begun."""
        return elapsed / self.done if self.done > 0.0 else None


@contextmanager
def share_progress(console: Console, name: str) -> Iterator[Callable[[str, float], None]]:
    """Gives what is to be called with (what is done now, share that is done, 0 to 1): a bar on a terminal,
    a line now and then elsewhere."""
    if console.is_terminal:
        columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), TimeRemainingColumn())
        with Progress(*columns, console=console, transient=True) as bar:
            task = bar.add_task(name, total=1.0)
            yield lambda text, share: bar.update(task, description=f"{name}: {text}", completed=share)
        return
    forecast = _Share()
    with RunProgress(console, name, forecast) as lines:

        def tell(text: str, share: float) -> None:
            forecast.done = share
            lines.say(text)

        yield tell


def in_minutes(seconds: float) -> str:
    """A time as minutes and seconds: 1:05."""
    whole = round(seconds)
    return f"{whole // 60}:{whole % 60:02d}"
