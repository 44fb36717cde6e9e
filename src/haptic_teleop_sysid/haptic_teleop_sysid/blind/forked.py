"""Diagnoses in processes of their own that need not import anything first.

A fork server imports `diagnose` once and does nothing else; every diagnosis is a fork of it, so none sees
what another one did.
"""

from __future__ import annotations

import multiprocessing
import os
import tempfile
import time
from collections.abc import Callable, Sequence
from typing import IO

_SERVER = multiprocessing.get_context("forkserver")
_SERVER.set_forkserver_preload(
    [
        "haptic_teleop_control.front_door",
        "haptic_teleop_sysid.commands.diagnose",
        "haptic_teleop_sim.kernel.predict",
    ]
)

_LOOK = 1.0
"""s between two looks at what a fork has printed."""


def run_forked(
    executable: str, arguments: Sequence[str], timeout: float, tell: Callable[[str], None] | None = None
) -> tuple[str, list[str]]:
    """Run one of the project's executables in a fork; return its exit status (or `timeout`) and last words.

    What it prints goes to a file that is deleted. ``timeout`` in seconds, after which the process is killed.
    ``tell``: gets each line that it prints on standard error, when it does.
    """
    with tempfile.NamedTemporaryFile("r", suffix=".txt") as words:
        process = _SERVER.Process(target=_child, args=(executable, list(arguments), words.name))
        process.start()
        deadline = time.monotonic() + timeout
        while process.exitcode is None and time.monotonic() < deadline:
            process.join(min(_LOOK, deadline - time.monotonic()) if tell is not None else timeout)
            if tell is not None:
                _tell_new_lines(words, tell)
        ended = process.exitcode is not None
        if not ended:
            process.kill()
            process.join()
        if tell is not None:  # what came between the last look and the end
            _tell_new_lines(words, tell)
        if not ended:
            return "timeout", []
        words.seek(0)
        return str(process.exitcode), words.read().strip().splitlines()[-1:]


def _tell_new_lines(words: IO[str], tell: Callable[[str], None]) -> None:
    """Tell the lines that are whole by now; the rest of the file is read again."""
    while True:
        place = words.tell()
        line = words.readline()
        if not line.endswith("\n"):
            words.seek(place)
            return
        tell(line.rstrip())


def _child(executable: str, arguments: list[str], words: str) -> None:
    from haptic_teleop_control.front_door import start

    with open(words, "w") as said, open(os.devnull, "w") as nowhere:
        os.dup2(said.fileno(), 2)
        os.dup2(nowhere.fileno(), 1)
    raise SystemExit(start(executable, arguments))
