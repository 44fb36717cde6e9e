"""Where a run may write: results of an earlier run are never overwritten unasked."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from haptic_teleop_control.errors import ConfigurationError


def claim_output_directory(directory: str | Path, result_name: str, overwrite: bool = False) -> Path:
    """Return `directory`, created if needed, when it holds no `result_name` of an earlier run.

    Raises ConfigurationError when it does and `overwrite` is false, or when the path is a recording, a file
    or cannot be written.
    """
    path = Path(directory)
    if (path / result_name).exists() and not overwrite:
        raise ConfigurationError(
            f"{path} already holds the {result_name} of an earlier run: choose another --output, or say "
            f"--overwrite."
        )
    make_output_directory(path)
    return path


def refuse_inputs(output: Path, inputs: Iterable[str | Path]) -> None:
    """ConfigurationError where a run would write its result over what it reads, or into a recording."""
    for one in map(Path, inputs):
        over = output.exists() and one.exists() and output.samefile(one)
        if over or (one.is_dir() and output.parent.exists() and output.parent.samefile(one)):
            raise ConfigurationError(
                f"--output {output} is what this run reads, and would be lost: choose another --output."
            )


@contextmanager
def claimed(directory: str | Path, result_name: str, overwrite: bool = False) -> Iterator[Path]:
    """As `claim_output_directory`, for as long as results are computed: whoever leaves early (an error,
    Ctrl-C) leaves no empty folder behind. An interrupt then carries a sentence on what was written."""
    path = Path(directory)
    missing = [folder for folder in (path, *path.parents) if not folder.exists()]
    claim_output_directory(path, result_name, overwrite)
    with left_tidy(path, missing):
        yield path


@contextmanager
def left_tidy(path: Path, missing: list[Path], goes_on: bool = False) -> Iterator[None]:
    """Remove what is empty of the folders that were ``missing``, and within ``path`` of those that were made,
    when what is done in it ends early. ``goes_on``: the same command goes on from what is kept there."""
    before = _inside(path)
    try:
        yield
    except BaseException as leaving:
        made = sorted((p for p in path.rglob("*") if p.is_dir() and p not in before), reverse=True)
        for folder in (*made, *missing):
            try:
                folder.rmdir()
            except OSError:  # it holds something
                continue
        if not isinstance(leaving, KeyboardInterrupt):
            raise
        told = "interrupted; nothing was written"
        if path.exists() and _inside(path) != before:
            told = f"interrupted; {path} holds what was written so far"
            told += ": the same command goes on from there" if goes_on else ", which is no whole result"
        raise KeyboardInterrupt(told) from leaving


def _inside(path: Path) -> dict[Path, int]:
    """What a folder holds, with times of change."""
    return {p: p.stat().st_mtime_ns if p.is_file() else 0 for p in path.rglob("*")}


def make_output_directory(path: Path) -> None:
    """Make the folder `path` where it is missing; ConfigurationError where it cannot be one, or is a
    recording."""
    if path.is_dir() and any(p.suffix in (".mcap", ".db3") and p.is_file() for p in path.iterdir()):
        raise ConfigurationError(f"--output {path} is a recording: choose another --output.")
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigurationError(
            f"--output {path} cannot be used as a directory ({error.strerror}): choose another --output."
        ) from error


def numbered_output_directory(directory: str | Path) -> Path:
    """Return `directory`, or the first of `directory-2`, `directory-3`, ... that does not exist yet; it is
    created. Raises ConfigurationError where `directory` is a file, or cannot be made.
    """
    wanted = Path(directory)
    candidate, number = wanted, 1
    while True:
        try:
            candidate.mkdir(parents=True, exist_ok=False)
            return candidate
        except FileExistsError:
            if candidate == wanted and not wanted.is_dir():
                raise ConfigurationError(
                    f"--output {wanted} is a file: choose another --output."
                ) from None
            if candidate.is_dir() and not any(candidate.iterdir()):
                return candidate
            number += 1
            candidate = wanted.with_name(f"{wanted.name}-{number}")
        except OSError as error:
            raise ConfigurationError(
                f"--output {candidate} cannot be used as a directory ({error.strerror}): choose another "
                f"--output."
            ) from error
