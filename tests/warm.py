"""Commands as processes that need not load Python's packages first: forks of one that has."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

PARENT = """
import importlib, json, os, signal, sys, time

folder, names, ready = json.loads(sys.argv[1])
sys.argv = sys.argv[:1]
for name in names:
    try:
        importlib.import_module(name)
    except ImportError:
        pass  # of an environment without ROS 2
exec(ready)


def command(arguments, out, errors):
    for number, name, mode in ((0, os.devnull, os.O_RDONLY), (1, out, 577), (2, errors, 577)):
        os.dup2(os.open(name, mode), number)
    os.setsid()
    from haptic_teleop_control import front_door

    status = 1
    try:
        status = front_door.main(arguments)
    except SystemExit as end:
        status = end.code
    finally:
        sys.stdout.flush()
        with open(errors + ".loaded", "w") as file:
            json.dump(sorted(sys.modules), file)
        sys.stderr.flush()
        os._exit(status or 0)


for number, line in enumerate(sys.stdin):
    arguments, patience = json.loads(line)
    out, errors = (os.path.join(folder, f"{number}.{name}") for name in ("out", "errors"))
    child = os.fork()
    if not child:
        command(arguments, out, errors)
    end, status = time.monotonic() + patience, None
    while status is None:
        if time.monotonic() > end:
            os.kill(child, signal.SIGKILL)
        done, state = os.waitpid(child, os.WNOHANG)
        if done:
            status = os.waitstatus_to_exitcode(state)
        else:
            time.sleep(0.01)
    print(json.dumps([status, out, errors]), flush=True)
"""


class Done(NamedTuple):
    """returncode: as of a process, so negative where it did not end in time. loaded: the modules that it had,
    empty where it was ended."""

    returncode: int
    stdout: str
    stderr: str
    loaded: frozenset[str]


class Warm:
    """A process that has imported `modules` and done `ready`, Python, and becomes a command at each call; a
    context manager. What it imports must not be what a test of importing is about."""

    def __init__(self, folder: Path, modules: Sequence[str], ready: str = "") -> None:
        self._argument = json.dumps([str(folder), list(modules), ready])

    def __enter__(self) -> Self:
        self._process = subprocess.Popen(
            [sys.executable, "-c", PARENT, self._argument],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.communicate()

    def __call__(self, *arguments: str, timeout: float = 60.0) -> Done:
        """`haptic-teleop` with these arguments."""
        assert self._process.stdin is not None and self._process.stdout is not None
        print(json.dumps([arguments, timeout]), file=self._process.stdin, flush=True)
        status, out, errors = json.loads(self._process.stdout.readline())
        loaded = Path(f"{errors}.loaded")
        modules = json.loads(loaded.read_text()) if loaded.exists() else ()
        return Done(status, Path(out).read_text(), Path(errors).read_text(), frozenset(modules))
