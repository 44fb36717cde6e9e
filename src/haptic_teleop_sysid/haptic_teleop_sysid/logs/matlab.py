"""MAT files of all versions, by mat-io (which builds on scipy.io and h5py and opens MATLAB's tables, too)."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from matio import load_from_mat, whosmat

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_sysid.logs.arrays import columns_of
from haptic_teleop_sysid.logs.log import MOST_BYTES, Log, refuse_bytes

_COMPRESSED = 15
#: What whosmat calls variables that are no objects.
_PLAIN = (
    *("double", "single", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64"),
    *("logical", "char", "struct", "cell", "sparse"),
)
_HDF5 = b"\x89HDF\r\n\x1a\n"
#: What to type in MATLAB to make plain arrays of an object `x`.
_EXPORTS = {
    "timeseries": "time = x.Time; data = squeeze(x.Data); save('plain.mat', 'time', 'data')",
    "iddata": "time = x.SamplingInstants; u = x.InputData; y = x.OutputData; "
    "save('plain.mat', 'time', 'u', 'y')",
    "Simulink.SimulationData.Dataset": "s = x.get(1).Values; time = s.Time; data = squeeze(s.Data); "
    "save('plain.mat', 'time', 'data')",
    "Simulink.SimulationOutput": "s = x.yout.get(1).Values; time = s.Time; data = squeeze(s.Data); "
    "save('plain.mat', 'time', 'data')",
    "table": "writetable(x, 'plain.csv')",
    "timetable": "writetimetable(x, 'plain.csv')",
}
_EXPORT = "s = struct(x); save('plain.mat', '-struct', 's')"


def read_matlab(path: Path) -> Log:
    """Return the numeric content of a MAT file. Raises RecordingError where there is none: for objects that
    only MATLAB opens with the line to type there."""
    refuse_bytes(path, announced_bytes(path), "save fewer variables, or a part of them, in MATLAB")
    try:
        classes = {name: str(kind) for name, (_, kind) in whosmat(str(path)).items()}
    except Exception as error:  # libraries raise of every kind on a damaged file
        raise RecordingError(_damaged(path, error)) from error
    plain: dict[str, Any] = {}
    told: list[str] = []
    for name, kind in classes.items():
        try:
            value = load_from_mat(str(path), variable_names=[name])[name]
        except Exception as error:
            if kind in _PLAIN:
                raise RecordingError(_damaged(path, error)) from error
            value = None
        unopened = kind not in _PLAIN and getattr(value, "dtype", None) == np.uint32  # what points to it
        if value is None or unopened or _opaque(value):
            told.append(_sentence(name, _class_of(value, kind)))
        else:
            plain[name] = value
    columns, remarks = columns_of(plain)
    if not columns:
        why = told[0] if told else "it has no numeric array of ten or more rows: save the log's arrays"
        raise RecordingError(f"{path}: {why}.")
    return Log(path, "MATLAB", tuple(columns), remarks=("read as a MAT file", *remarks, *told))


def _damaged(path: Path, error: Exception) -> str:
    return (
        f"{path} is damaged or no MAT file that can be read ({type(error).__name__}: {error}): save it again "
        "in MATLAB."
    )


def _opaque(value: Any) -> bool:
    return type(value).__name__.startswith("MatlabOpaque") or type(value).__name__ in (
        "MatlabObject",
        "MatlabFunction",
    )


def _class_of(value: Any, kind: str) -> str:
    return str(getattr(value, "classname", "") or kind or "of an unknown class")


def _sentence(name: str, kind: str) -> str:
    line = _EXPORTS.get(kind, _EXPORT).replace("x.", f"{name}.").replace("(x", f"({name}")
    return (
        f"{name} is a MATLAB object of class {kind}, which only MATLAB opens: type there `{line}` and import "
        "what it writes"
    )


def announced_bytes(path: Path) -> float:
    """Bytes that the variables of a file announce to fill, found without unpacking them; no less than those
    of the file."""
    size = path.stat().st_size
    return size if size > MOST_BYTES else _summed(path)


def _summed(path: Path) -> float:
    with path.open("rb") as stream:
        head = stream.read(1024)
        if _HDF5 in (head[:8], head[512:520]):
            return _announced_hdf5(path)
        if not head.startswith(b"MATLAB"):
            return path.stat().st_size
        order = "<" if head[126:128] == b"IM" else ">"
        total, place = 0, 128
        while True:
            stream.seek(place)
            tag = stream.read(8)
            if len(tag) < 8:
                return total
            kind, size = struct.unpack(f"{order}II", tag)
            if kind == 0:
                return total  # zeros, as of a file that was not written to its end
            if kind == _COMPRESSED:
                start = zlib.decompressobj().decompress(stream.read(min(size, 256)), 8)
                total += struct.unpack(f"{order}II", start)[1] if len(start) == 8 else 0
                place += 8 + size
            else:
                total += size
                place += 8 + size + (-size) % 8


def _announced_hdf5(path: Path) -> float:
    sizes: list[int] = []

    def add(_: str, entry: Any) -> None:
        if isinstance(entry, h5py.Dataset):
            sizes.append(int(entry.size or 0) * 8)

    try:
        with h5py.File(path, "r") as file:
            file.visititems(add)
    except (OSError, RuntimeError, KeyError) as error:
        raise RecordingError(f"{path} is a damaged MAT file ({error}): save it again in MATLAB.") from error
    return sum(sizes)
