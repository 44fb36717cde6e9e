"""Generates cases and runs `diagnose` on them, each in its own process."""

from __future__ import annotations

import json
import multiprocessing
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_sysid.blind.forked import run_forked
from haptic_teleop_sysid.blind.sealing import seal
from haptic_teleop_sysid.spread import ONE_THREAD

FRONT_DOOR = (
    sys.executable,
    "-c",
    "from haptic_teleop_control.front_door import main; raise SystemExit(main())",
    "diagnose",
)
RAN = "run.json"


def parse_cases(text: str, known: tuple[str, ...]) -> dict[str, int]:
    """Return {kind: number} of `single=300,clean=300`. ConfigurationError on anything else."""
    found: dict[str, int] = {}
    for piece in text.split(","):
        kind, _, number = piece.strip().partition("=")
        if kind not in known or not number.isdigit() or kind in found:
            raise ConfigurationError(
                f"--cases {piece.strip()!r} is not KIND=NUMBER with KIND once out of {', '.join(known)}: "
                f'write it like "single=30,clean=30".'
            )
        found[kind] = int(number)
    if not sum(found.values()):
        raise ConfigurationError("--cases asks for no case: give at least one.")
    return found


def plan(seed: int, cases: dict[str, int]) -> list[tuple[str, str, int]]:
    """Return (name, kind, index) of every case, in an order that says nothing about the kind."""
    listed = [(kind, index) for kind, number in cases.items() for index in range(number)]
    order = np.random.default_rng((seed, 77)).permutation(len(listed))
    return [(f"case{place + 1:04d}", *listed[i]) for place, i in enumerate(order)]


def generate(job: tuple[int, str, str, int, Path, tuple[float, ...]]) -> tuple[str, dict[str, Any], float]:
    """Draw and write one case; return its name, label and the seconds it took."""
    from haptic_teleop_sysid.blind.bags import write_case
    from haptic_teleop_sysid.blind.cases import draw_case

    seed, name, kind, index, directory, levels = job
    begin = time.perf_counter()
    target = directory / name
    if target.exists():
        shutil.rmtree(target)  # a case cut off in the middle of its writing
    target.mkdir(parents=True)
    label = write_case(draw_case(seed, kind, index, name, levels), target)
    return name, label, time.perf_counter() - begin


def generate_again(job: tuple[int, str, str, int, Path, tuple[float, ...]]) -> None:
    """Draw and write one case whose label is sealed already; seal the new one beside it, to be compared."""
    name, label, _ = generate(job)
    seal({name: label}, job[4] / name, str(job[0]))


def diagnose(
    directory: Path,
    command: tuple[str, ...],
    timeout: float,
    tell: Callable[[str], None] | None = None,
) -> dict[str, Any]:
    """Run the command on one case; write and return what happened: status, seconds, last words.
    ``tell``: gets each line of progress that this installation's own `diagnose` prints.

    This installation's own `diagnose` (FRONT_DOOR and options) is forked from a process that has it imported,
    unless this is a worker of Dask, which may have no children of that kind.
    """
    output = directory / "diagnosis"
    if output.exists():
        shutil.rmtree(output)
    arguments = [
        *("--model", str(directory / "model.yaml")),
        *("--estimation", str(directory / "estimation")),
        *("--validation", str(directory / "validation")),
        *("--output", str(output)),
    ]
    begin = time.perf_counter()
    if command[: len(FRONT_DOOR)] == FRONT_DOOR and not multiprocessing.current_process().daemon:
        os.environ.update(ONE_THREAD)
        own = [*command[len(FRONT_DOOR) :], *arguments]
        status, words = run_forked("diagnose", own, timeout, tell)
    else:
        try:
            done = subprocess.run(
                [*command, *arguments],
                capture_output=True,
                text=True,
                timeout=timeout,
                env={**os.environ, **ONE_THREAD},
            )
            status, words = str(done.returncode), done.stderr.strip().splitlines()[-1:]
        except subprocess.TimeoutExpired:
            status, words = "timeout", []
    ran = {"status": status, "seconds": time.perf_counter() - begin, "message": " ".join(words)}
    (directory / RAN).write_text(json.dumps(ran))
    return ran
