"""Which files make up a recording, and what its metadata.yaml says."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path, PurePath
from tempfile import SpooledTemporaryFile
from typing import Any, BinaryIO, cast

import yaml

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_control.named_files import similar
from haptic_teleop_control.recording.expansion import Budget, expand_file
from haptic_teleop_control.recording.mcap_records import MAGIC

METADATA = "metadata.yaml"
SQLITE_MAGIC = b"SQLite format 3\0"
IN_MEMORY = 64 << 20
"""Of a file that is compressed as a whole; what is more lies on the disk while it is read."""
SUFFIXES = {"mcap": (".mcap", ".mcap.zstd"), "sqlite3": (".db3", ".db3.zstd")}


@dataclass
class BagFiles:
    """The files of the recording at ``path`` in their order, all of one ``storage`` ("mcap" or "sqlite3").

    ``information`` is the mapping in metadata.yaml, {} when there is none; ``problem`` says what is wrong
    with it, and ``missing`` names files that it lists and that are not there.
    """

    path: Path
    files: list[Path]
    storage: str
    information: dict[str, Any] = field(default_factory=dict)
    problem: str = ""
    missing: list[str] = field(default_factory=list)


def find_files(path: Path) -> BagFiles:
    """The recording at ``path``, a directory or a storage file; RecordingError when there is none."""
    try:
        if path.name == METADATA and path.is_file():
            path = path.parent
        if path.is_dir():
            return _open_directory(path)
        if path.is_file():
            return BagFiles(path, [path], _storage_of(path))
    except PermissionError:
        raise RecordingError(f"{path}: it may not be read: ask for permission to read it") from None
    near = similar(path)
    raise RecordingError(
        f"{path}: there is no such file or directory: "
        + (f"did you mean {near}?" if near else "name a recording (a rosbag2 directory)")
    )


def _open_directory(path: Path) -> BagFiles:
    information, problem = _read_metadata(path)
    storage = str(information.get("storage_identifier") or "")
    if storage and storage not in SUFFIXES:
        raise RecordingError(
            f"{path}: storage {storage!r} is not known: convert it with `ros2 bag convert` to mcap"
        )
    names = information.get("relative_file_paths")
    if isinstance(names, list) and names:
        listed = [path / PurePath(str(name)).name for name in names]
        files = [file for file in listed if file.is_file()]
        missing = [
            f"{file}: it is listed in {METADATA} but is not there" for file in listed if file not in files
        ]
    else:
        files, missing = [], []
    if not files:
        files = sorted((f for f in path.iterdir() if f.is_file() and _kind(f.name)), key=_by_number)
    if not files:
        raise RecordingError(_nothing_in(path, missing))
    kinds = {_kind(file.name) for file in files}
    if not storage:
        storage = "mcap" if "mcap" in kinds else "sqlite3"
        files = [file for file in files if _kind(file.name) == storage]
    return BagFiles(path, files, storage, information, problem, missing)


def _read_metadata(path: Path) -> tuple[dict[str, Any], str]:
    file = path / METADATA
    try:
        information = yaml.safe_load(file.read_text())["rosbag2_bagfile_information"]
        if isinstance(information, dict):
            return information, ""
    except FileNotFoundError:
        return (
            {},
            f"{file}: it is missing, as when the recorder was killed; `haptic-teleop recover` writes it anew",
        )
    except (yaml.YAMLError, UnicodeDecodeError, KeyError, TypeError):
        pass
    return {}, f"{file}: it is damaged; `haptic-teleop recover` writes it anew"


def _nothing_in(path: Path, missing: list[str]) -> str:
    inner = sorted(p.name for p in path.iterdir() if p.is_dir() and any(_kind(f.name) for f in p.iterdir()))
    if inner:
        shown = ", ".join(inner[:5]) + (", ..." if len(inner) > 5 else "")
        return f"{path}: it is a folder of recordings: name one of them ({shown})"
    if missing:
        return f"{path}: {METADATA} is there but its data is not: copy the .mcap files beside it"
    return f"{path}: it holds no recording (no .mcap or .db3 file): name a rosbag2 directory"


def _storage_of(file: Path) -> str:
    if kind := _kind(file.name):
        return kind
    with file.open("rb") as stream:
        head = stream.read(16)
    if head.startswith(MAGIC):
        return "mcap"
    if head.startswith(SQLITE_MAGIC):
        return "sqlite3"
    raise RecordingError(f"{file}: it is no recording: name a rosbag2 directory, or an .mcap or .db3 file")


def _kind(name: str) -> str | None:
    return next((kind for kind, suffixes in SUFFIXES.items() if name.endswith(suffixes)), None)


def _by_number(file: Path) -> list[Any]:
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", file.name)]


def open_storage(file: Path, budget: Budget) -> BinaryIO:
    """An MCAP file opened for reading, decompressed if it is compressed as a whole; Damaged when it cannot
    be, TooLarge when it expands beyond `budget`."""
    if not file.name.endswith(".zstd"):
        return file.open("rb")
    unpacked = cast(BinaryIO, SpooledTemporaryFile(IN_MEMORY))  # noqa: SIM115 - the caller closes it
    try:
        with file.open("rb") as packed:
            expand_file(packed, unpacked, budget)
    except BaseException:
        unpacked.close()
        raise
    return unpacked
