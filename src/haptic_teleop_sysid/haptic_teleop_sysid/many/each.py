"""One piece of work for each recording: those that are kept are read, the others are done side by side."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from haptic_teleop_sysid.estimation.parallel import VARIABLE
from haptic_teleop_sysid.report.output import left_tidy, make_output_directory
from haptic_teleop_sysid.spread import ONE_THREAD, spread

from .kept import attempt, kept, key_of


@dataclass(frozen=True)
class Job:
    """``work(*arguments, folder)`` of what lies in ``recordings``; ``settings`` (anything that prints itself
    whole) tells its results from others'."""

    name: str
    folder: Path
    recordings: tuple[Path, ...]
    work: Callable[..., Mapping[str, Any]]
    arguments: tuple[Any, ...]
    settings: object


@dataclass(frozen=True)
class Means:
    """Where it runs: ``jobs`` processes, -1 for all cores; ``dask``: a scheduler's address, or "local";
    ``afresh``: nothing that is kept counts."""

    jobs: int = -1
    dask: str | None = None
    afresh: bool = False


def each(task: str, jobs: Sequence[Job], means: Means) -> tuple[dict[str, dict[str, Any]], int]:
    """Return the outcomes by the jobs' names, in their order, and how many were kept from earlier runs.

    Each is kept in its folder as it ends, by whoever did it, so that a run that was killed goes on. A
    cluster has to see recordings and results under the same names as this machine.
    """
    keys = {job.name: key_of(task, job.recordings, job.settings) for job in jobs}
    found = {job.name: None if means.afresh else kept(job.folder, keys[job.name]) for job in jobs}
    waiting = [job for job in jobs if found[job.name] is None]
    alone = means.dask is not None
    handed = [(job.name, job.work, job.folder, keys[job.name], job.arguments, alone) for job in waiting]
    with _threads(len(waiting), means.jobs):
        found |= dict(spread(_named, handed, means.jobs, means.dask, task))
    return {name: outcome for name, outcome in found.items() if outcome is not None}, len(jobs) - len(waiting)


@contextmanager
def _threads(waiting: int, jobs: int) -> Iterator[None]:
    """An environment, inherited by processes that begin in it, in which they share the cores evenly."""
    before, cores = dict(os.environ), len(os.sched_getaffinity(0))
    at_once = min(max(waiting, 1), jobs if jobs > 0 else cores)
    os.environ.update(ONE_THREAD | {VARIABLE: str(max(1, cores // at_once))})
    try:
        yield
    finally:
        for name in ONE_THREAD:
            os.environ.pop(name)
            if name in before:
                os.environ[name] = before[name]


@contextmanager
def claim(output: Path) -> Iterator[Path]:
    """The folder of results, made if needed, for as long as they are computed; see `left_tidy` for who leaves
    early. Raises ConfigurationError where it cannot be one."""
    whole = output.resolve()  # workers of a cluster stand elsewhere
    missing = [folder for folder in (whole, *whole.parents) if not folder.exists()]
    make_output_directory(output)
    with left_tidy(whole, missing, goes_on=True):
        yield whole


def _named(
    name: str,
    work: Callable[..., Mapping[str, Any]],
    folder: Path,
    key: str,
    arguments: Sequence[Any],
    alone: bool,
) -> tuple[str, dict[str, Any]]:
    return name, attempt(work, folder, key, arguments, alone)
