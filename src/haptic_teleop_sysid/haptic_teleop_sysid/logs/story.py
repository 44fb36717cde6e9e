"""How a log was read and what was changed on the way, for commands that take logs in place of recordings."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.console import Console


def how_read(experiment: Mapping[str, Any], name: str | Path) -> list[str]:
    """Return how the log ``name`` was read, in sentences; nothing for what is a recording, or the recording
    of a log, which `import` told of."""
    story = experiment.get("import")
    if not isinstance(story, dict) or story.get("file") != Path(name).name:
        return []
    return [str(line) for line in (*story.get("read", ()), *story.get("changes", ()))]


def tell(screen: Console, experiments: Mapping[str, Mapping[str, Any]]) -> None:
    """Say once on a console, by what each log is called, how it was read."""
    for name, experiment in experiments.items():
        for line in how_read(experiment, name):
            screen.print(f"{name}: {line}", markup=False, highlight=False, soft_wrap=True)
