"""What was found out about a recording, kept so that it is not computed again."""

from __future__ import annotations

import hashlib
import json
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.errors import HapticTeleopError
from haptic_teleop_sysid.estimation.parallel import by_itself
from haptic_teleop_sysid.results import tool_version, write_json

DONE, UNUSABLE, FAILED = "done", "unusable", "failed"
"""How a recording ended: with a result; with a sentence about it; with a failure of the program."""
OUTCOME = "outcome.json"
FORMAT = 2
"""Of what an outcome holds: one of another format is computed again."""


def key_of(task: str, recordings: Sequence[Path], settings: object) -> str:
    """Return what tells a result from one of other recordings, settings or version: sizes and times of all
    files, and what the settings print."""
    files = []
    for recording in recordings:
        parts = sorted(p for p in recording.rglob("*") if p.is_file()) if recording.is_dir() else [recording]
        files += [[p.name, p.stat().st_size, p.stat().st_mtime_ns] for p in parts if p.exists()]
    text = json.dumps([tool_version(), FORMAT, task, files, repr(settings)])
    return hashlib.sha256(text.encode()).hexdigest()


def kept(folder: Path, key: str) -> dict[str, Any] | None:
    """Return the outcome in a folder, if it is of this key and came to an end that would be the same."""
    try:
        found = json.loads((folder / OUTCOME).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    if not isinstance(found, dict) or found.get("key") != key or found.get("status") == FAILED:
        return None
    return found


def numbers(values: Sequence[float | None]) -> NDArray[np.float64]:
    """Return values (n,) of outcomes; NaN for those that JSON keeps as null."""
    return np.array(values, dtype=np.float64)


def attempt(
    work: Callable[..., Mapping[str, Any]], folder: Path, key: str, arguments: Sequence[Any], alone: bool
) -> dict[str, Any]:
    """Return and keep the outcome of ``work(*arguments, folder)``: its ``status``, ``message`` and seconds
    beside what it returns. One recording that cannot be used, or makes the program fail, stops no other.
    ``alone``: on one thread, whatever the environment says."""
    began = time.perf_counter()
    outcome: dict[str, Any] = {"key": key, "status": DONE, "message": ""}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        outcome |= by_itself(work, *arguments, folder) if alone else work(*arguments, folder)
    except HapticTeleopError as error:
        outcome |= {"status": UNUSABLE, "message": " ".join(str(error).split())}
    except Exception as error:  # a defect met in one recording of a hundred
        words = " ".join(str(error).split())
        outcome |= {"status": FAILED, "message": f"the program failed: {type(error).__name__}: {words}"}
        outcome["traceback"] = traceback.format_exc()
    outcome["seconds"] = round(time.perf_counter() - began, 3)
    write_json(folder / OUTCOME, outcome)
    return json.loads((folder / OUTCOME).read_text(encoding="utf-8"))
