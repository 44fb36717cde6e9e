"""Any log by what its bytes say it is, not by its name."""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from haptic_teleop_control.errors import ConfigurationError, HapticTeleopError, RecordingError
from haptic_teleop_control.named_files import similar
from haptic_teleop_sysid.logs.dialect import Stated
from haptic_teleop_sysid.logs.fill_values import without_fill
from haptic_teleop_sysid.logs.log import Log, refuse_rows

BAG_SUFFIXES = (".mcap", ".db3", ".bag")
SUFFIXES = (".csv", ".tsv", ".txt", ".dat", ".mat", ".npz", ".npy", ".parquet", ".pq", *BAG_SUFFIXES)
"""Endings by which a folder is searched for logs."""
_SPREADSHEET = (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",)
_PACKED = {
    b"\x1f\x8b": "gunzip",
    b"BZh": "bunzip2",
    b"\xfd7zXZ": "unxz",
    b"7z\xbc\xaf": "7z x",
    b"Rar!": "unrar x",
    b"\x28\xb5\x2f\xfd": "unzstd",
}
_ENCRYPTED = (b"Salted__", b"-----BEGIN PGP", b"age-encryption.org", b"PARE", b"LUKS\xba\xbe")


@dataclass(frozen=True)
class ReadOptions:
    """``stated``: what is said of a text table; ``rows`` (first, last), from 1; ``skip_ragged``; ``topics``
    of a bag; ``definitions``: .msg files."""

    stated: Stated | None = None
    rows: tuple[int, int] | None = None
    skip_ragged: bool = False
    topics: tuple[str, ...] | None = None
    definitions: Sequence[Path] = ()


def read_log(path: Path, options: ReadOptions | None = None) -> Log:
    """Return what a log holds. Raises RecordingError, with a remedy, for what is no log, is damaged,
    encrypted or too large to be taken."""
    options = options or ReadOptions()
    kind = kind_of(path)
    if options.rows is not None and kind == "bag":
        raise ConfigurationError(
            f"--rows goes with tables, and {path} is a bag: cut it with `ros2 bag convert`."
        )
    try:
        log = _read(path, kind, options)
        return replace(log, columns=tuple(without_fill(c) for c in log.columns))
    except HapticTeleopError:
        raise
    except MemoryError as error:
        raise RecordingError(
            f"{path} announces more than the memory holds: it is damaged, or needs to be cut into parts."
        ) from error
    except Exception as error:  # what libraries raise on a file that is not what it seems is of every kind
        raise RecordingError(
            f"{path} cannot be read ({type(error).__name__}: {error}): write it again, or export it as CSV."
        ) from error


def _read(path: Path, kind: str, options: ReadOptions) -> Log:
    # Each reader is imported when it is needed: pyarrow and h5py take longer than a small log.
    if kind == "bag":
        from haptic_teleop_sysid.logs.ros_bags import read_bag

        return read_bag(path, options.topics, options.definitions)
    if kind == "matlab":
        from haptic_teleop_sysid.logs.isolated import read_isolated
        from haptic_teleop_sysid.logs.matlab import read_matlab

        return _cut(read_isolated(read_matlab, path), options.rows)
    if kind == "numpy":
        from haptic_teleop_sysid.logs.packed_tables import read_numpy

        return _cut(read_numpy(path), options.rows)
    if kind == "parquet":
        from haptic_teleop_sysid.logs.packed_tables import read_parquet

        return read_parquet(path, options.rows)
    from haptic_teleop_sysid.logs.text_table import read_text

    return read_text(path, options.stated, options.rows, options.skip_ragged)


def kind_of(path: Path) -> str:
    """ "bag", "matlab", "numpy", "parquet" or "text". Raises RecordingError for what is known to be none."""
    try:
        if path.is_dir():
            return "bag"
        with path.open("rb") as stream:
            head = stream.read(1024)
    except FileNotFoundError:
        near = similar(path)
        raise RecordingError(
            f"{path}: there is no such file: {f'did you mean {near}?' if near else 'name a log.'}"
        ) from None
    except OSError as error:
        raise RecordingError(f"{path} cannot be read ({error.strerror or error}): name another.") from error
    if path.suffix.lower() in (".yaml", ".yml"):
        raise RecordingError(f"{path} is YAML, as models and scenarios are, and no log: name a recording.")
    if head.startswith(_ENCRYPTED):
        raise RecordingError(f"{path} is encrypted: decrypt it, and import what comes out.")
    if head.startswith(_SPREADSHEET):
        raise RecordingError(f"{path} is a spreadsheet: save its sheet as CSV, and import that.")
    if head.startswith((b"PK\x03\x04", b"PK\x05\x06")):
        _refuse_other_archives(path)
        return "numpy"
    for magic, command in _PACKED.items():
        if head.startswith(magic):
            raise RecordingError(f"{path} is packed: unpack it with `{command}`, and import what comes out.")
    if head.startswith((b"#ROSBAG", b"\x89MCAP", b"SQLite format 3")):
        return "bag"
    if head.startswith(b"MATLAB") or head[512:520] == b"\x89HDF\r\n\x1a\n" or _matlab_4(path, head):
        return "matlab"
    if head.startswith(b"\x89HDF"):
        return "matlab"
    if head.startswith(b"\x93NUMPY"):
        return "numpy"
    if head.startswith(b"PAR1"):
        return "parquet"
    return "text"


def _refuse_other_archives(path: Path) -> None:
    """Raise RecordingError for a zip file that is not npz, saying what it is."""
    try:
        with zipfile.ZipFile(path) as packed:
            names = packed.namelist()
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError) as error:
        what = "an npz file" if path.suffix.lower() == ".npz" else "a zip file"
        raise RecordingError(
            f"{path} begins as {what} and is damaged or cut short ({error}): copy or write it again."
        ) from error
    if any(name.endswith(".npy") for name in names):
        return
    sheets = any(name.startswith("xl/") or name == "content.xml" for name in names)
    if sheets or path.suffix.lower() in (".xlsx", ".ods"):
        raise RecordingError(f"{path} is a spreadsheet: save its sheet as CSV, and import that.")
    shown = ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
    raise RecordingError(
        f"{path} is a zip file with {shown or 'nothing'} in it, and no NumPy array: unpack it with `unzip`, "
        "and import what comes out."
    )


def _matlab_4(path: Path, head: bytes) -> bool:
    """MAT files of version 4 begin with zeros where others have text."""
    return path.suffix.lower() == ".mat" and len(head) > 20 and b"\0" in head[:4]


def _cut(log: Log, rows: tuple[int, int] | None) -> Log:
    taken = max((len(c.values) for c in log.columns), default=0)
    if rows is not None:
        taken = min(taken, rows[1] - rows[0] + 1)
    refuse_rows(log.path, taken, "take a part with `haptic-teleop import --rows FIRST LAST`")
    if rows is None:
        return log
    kept = slice(rows[0] - 1, rows[1])
    columns = tuple(replace(c, values=c.values[kept]) for c in log.columns)
    if not any(len(c.values) for c in columns):
        raise RecordingError(f"{log.path} has no rows {rows[0]} to {rows[1]}: give other --rows.")
    return replace(log, columns=columns)


def is_foreign(path: Path) -> bool:
    """Whether a path is a log that has to be imported, and no recording of joint states as it is: neither a
    directory nor an MCAP or SQLite file. A path that is not there is no log."""
    if not path.is_file():
        return False
    if path.name.endswith((".mcap", ".db3", ".zstd")) or path.name == "metadata.yaml":
        return False
    with path.open("rb") as stream:
        head = stream.read(16)
    return not head.startswith((b"\x89MCAP", b"SQLite format 3"))
