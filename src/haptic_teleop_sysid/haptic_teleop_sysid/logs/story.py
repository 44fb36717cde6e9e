"""How a log was read and what was changed on the way, for commands that take logs in place of recordings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console

from haptic_teleop_control.errors import HapticTeleopError
from haptic_teleop_sysid.report.terminal import say

UNUSED = "columns that were not needed"
"""How a sentence on them begins."""


def how_read(experiment: Mapping[str, Any], name: str | Path) -> list[str]:
    """Return how the log ``name`` was read, in sentences; nothing for what is a recording, or the recording
    of a log, which `import` told of."""
    story = _story(experiment, name)
    return [str(line) for line in (*story.get("read", ()), *story.get("changes", ()))]


def tell(screen: Console, experiments: Mapping[str, Mapping[str, Any]], verbose: bool = False) -> None:
    """Say once on a console, by what each log is called, how it was read: in one line, and what was done to
    it beyond reading its columns; ``verbose``: all that `import` tells."""
    for name, experiment in experiments.items():
        lines = how_read(experiment, name)
        if lines and not verbose:
            story = _story(experiment, name)
            by = "its headers" if story["by"] == "header" else story["by"]
            more = [n for n in lines if n not in story["columns"] and not n.startswith(("read as", UNUSED))]
            lines = [f"read by {by}; -v tells how", *more]
        for line in lines:
            say(screen, f"{name}: {line}")


@contextmanager
def reported(problems: Mapping[str, Sequence[str]]) -> Iterator[None]:
    """A context in which a refusal takes along what is odd about the recordings (name -> sentences), so that
    it is printed before it: one of them is often the cause."""
    try:
        yield
    except HapticTeleopError as refusal:
        said = getattr(refusal, "__notes__", [])
        for name, sentences in problems.items():
            for line in (f"{name}: {sentence}" for sentence in sentences):
                if line not in said:
                    refusal.add_note(line)
        raise


def _story(experiment: Mapping[str, Any], name: str | Path) -> Mapping[str, Any]:
    """What `convert` tells of the log ``name``; nothing for another recording."""
    story = experiment.get("import")
    return story if isinstance(story, dict) and story.get("file") == Path(name).name else {}
