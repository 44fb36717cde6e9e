"""Work on many things at once: over all cores of this machine, or over a Dask cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext
from typing import Any

from rich.console import Console

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_sysid.run_progress import share_progress

ONE_THREAD: dict[str, str] = {
    **{f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")},
    "HAPTIC_TELEOP_THREADS": "1",
}
"""Environment of a process that is one of many."""


@contextmanager
def _workers(
    jobs: int, dask: str | None, threads: bool
) -> Iterator[Callable[[Iterable[Any]], Iterable[Any]]]:
    try:
        from joblib import Parallel, parallel_config
    except ImportError:
        raise ConfigurationError("joblib is missing: pip install joblib.") from None
    if dask is None:
        backend = "threading" if threads else "loky"  # a diagnosis is a process already
        yield Parallel(n_jobs=jobs, backend=backend, return_as="generator_unordered")
        return
    try:
        from dask.distributed import Client, LocalCluster  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise ConfigurationError("--dask needs Dask: pip install 'dask[distributed]'.") from None
    try:
        # One thread each: Python's lock would let others wait.
        alone = {"n_workers": max(jobs, 0) or None, "threads_per_worker": 1}
        cluster = LocalCluster(**alone, dashboard_address="127.0.0.1:0") if dask == "local" else None
        client = Client(address=dask if cluster is None else cluster)
    except (OSError, ValueError) as failure:
        raise ConfigurationError(
            f"--dask {dask}: no scheduler answers there ({failure}). Start one (`dask scheduler`), or say "
            "`--dask local`."
        ) from None
    with cluster or nullcontext(), client, parallel_config(backend="dask"):
        yield Parallel(n_jobs=-1, return_as="generator_unordered")


def spread(
    work: Callable[..., Any],
    jobs_of: list[tuple[Any, ...]],
    jobs: int,
    dask: str | None,
    title: str,
    threads: bool = False,
) -> list[Any]:
    """Return the results of `work(*arguments)`, as they come, with their progress on standard error.

    ``jobs``: processes (``threads``: threads) at once, -1 for all cores; ``dask``: None, the address of a
    scheduler, or "local" for a cluster of ``jobs`` processes here. Raises ConfigurationError where no
    scheduler answers or a library is missing.
    """
    from joblib import delayed

    results: list[Any] = []
    if not jobs_of:
        return results
    total = len(jobs_of)
    with (
        share_progress(Console(stderr=True), title) as tell,
        _workers(jobs, dask, threads) as parallel,
    ):
        tell(f"0 of {total}", 0.0)
        for result in parallel(delayed(work)(*arguments) for arguments in jobs_of):
            results.append(result)
            tell(f"{len(results)} of {total}", len(results) / total)
    return results
