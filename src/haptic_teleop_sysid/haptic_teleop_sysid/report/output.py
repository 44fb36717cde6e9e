"""Where a run may write: results of an earlier run are never overwritten unasked."""

from __future__ import annotations

from pathlib import Path

from haptic_teleop_control.errors import ConfigurationError


def claim_output_directory(directory: str | Path, result_name: str, overwrite: bool = False) -> Path:
    """Return `directory`, created if needed, when it holds no `result_name` of an earlier run.

    Raises ConfigurationError when it does and `overwrite` is false, or when the path is a file or cannot be
    written.
    """
    path = Path(directory)
    if (path / result_name).exists() and not overwrite:
        raise ConfigurationError(
            f"{path} already holds the {result_name} of an earlier run: choose another --output, or say "
            f"--overwrite."
        )
    make_output_directory(path)
    return path


def make_output_directory(path: Path) -> None:
    """Make the folder `path` where it is missing; ConfigurationError where it cannot be one."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigurationError(
            f"--output {path} cannot be used as a directory ({error.strerror}): choose another --output."
        ) from error


def numbered_output_directory(directory: str | Path) -> Path:
    """Return `directory`, or the first of `directory-2`, `directory-3`, ... that does not exist yet; it is
    created.
    """
    wanted = Path(directory)
    candidate, number = wanted, 1
    while True:
        try:
            candidate.mkdir(parents=True, exist_ok=False)
            return candidate
        except FileExistsError:
            if candidate.is_dir() and not any(candidate.iterdir()):
                return candidate
            number += 1
            candidate = wanted.with_name(f"{wanted.name}-{number}")
        except OSError as error:
            raise ConfigurationError(
                f"--output {candidate} cannot be used as a directory ({error.strerror}): choose another "
                f"--output."
            ) from error
