"""Files that parameters name: where they lie, and the text of model files, which a recording keeps."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

FILE_KEYS = ("model", "file")
"""Last parts of names of parameters that name a file, relative to the parameter file that states it."""

MODEL_KEY = "model"
MODEL_BYTES = 1_000_000
"""A model file is some kB; what is longer is none, and is not kept."""


def names_a_file(name: str) -> bool:
    """Whether the parameter `name` (dotted) holds the path of a file."""
    return name.rsplit(".", 1)[-1] in FILE_KEYS


def located(name: str, value: Any, folder: Path) -> Any:
    """The value of parameter `name`: of one that names a file its absolute path, sought in `folder` first and
    then in the working directory; any other value, and a file that is in neither, as it is.
    """
    if not value or not names_a_file(name):
        return value
    for candidate in (folder / value, Path(value)):
        if candidate.is_file():
            return str(candidate.resolve())
    return value


def why_unreadable(path: str | Path, error: OSError | UnicodeDecodeError, holds: str = "") -> str:
    """Why a file cannot be read, in words, and which one may be meant: `holds`, where a folder was named and
    it has such a file, or a neighbour of nearly the same name."""
    path = Path(path)
    if isinstance(error, UnicodeDecodeError):
        return "it is no UTF-8 text; name another"
    if isinstance(error, IsADirectoryError):
        inside = bool(holds) and (path / holds).is_file()
        return "it is a folder; " + (f"did you mean {path / holds}?" if inside else "name a file in it")
    if isinstance(error, FileNotFoundError):
        near = similar(path)
        return "there is no such file; " + (f"did you mean {near}?" if near else "correct the path")
    return str(error.strerror or error)


def similar(path: Path) -> Path | None:
    """What lies in the same folder under nearly the same name as a file that does not exist; None where
    nothing does."""
    try:
        names = [one.name for one in path.parent.iterdir()]
    except OSError:
        return None
    near = difflib.get_close_matches(path.name, names, n=5, cutoff=0.6)
    near = [name for name in near if difflib.get_close_matches(path.stem, [Path(name).stem], cutoff=0.7)]
    return path.with_name(near[0]) if near else None


def model_texts(parameters: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    """Path as the parameters (node -> {dotted key: value}) state it -> text, of the model files that they
    name. What cannot be read is left out: its node has told so.
    """
    found: dict[str, str] = {}
    for values in parameters.values():
        for name, value in values.items():
            if name.rsplit(".", 1)[-1] != MODEL_KEY or not isinstance(value, str) or not value:
                continue
            try:
                if Path(value).is_file() and Path(value).stat().st_size <= MODEL_BYTES:
                    found[value] = Path(value).read_text(encoding="utf-8")
            except (OSError, UnicodeDecodeError):
                continue
    return found
