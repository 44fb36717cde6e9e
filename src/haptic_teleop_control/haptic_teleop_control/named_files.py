"""Files that parameters name: where they lie, and the text of model files, which a recording keeps."""

from __future__ import annotations

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
