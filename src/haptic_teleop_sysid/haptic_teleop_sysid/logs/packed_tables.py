"""Tables in binary files: NumPy's npz and npy, and Parquet."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.lib import format as npy
from pyarrow import parquet

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_sysid.logs.arrays import columns_of
from haptic_teleop_sysid.logs.log import Column, Log, refuse_bytes, refuse_rows

_PART = "write a part of it, with the tool that made it"


def read_numpy(path: Path) -> Log:
    """Return the arrays of an npz or npy file; objects are never unpickled."""
    try:
        if zipfile.is_zipfile(path):
            with zipfile.ZipFile(path) as packed:
                if any(one.flag_bits & 1 for one in packed.infolist()):
                    raise RecordingError(f"{path} is encrypted: decrypt it, and import what comes out.")
                refuse_bytes(path, sum(one.file_size for one in packed.infolist()), _PART)
            with np.load(path, allow_pickle=False) as file:
                content = {name: _array(file, name) for name in file.files}
        else:
            with path.open("rb") as stream:
                shape, _, kind = _header(stream)
            refuse_bytes(path, float(np.prod(shape, dtype=np.float64)) * kind.itemsize, _PART)
            content = {path.stem: np.load(path, allow_pickle=False)}
    except (ValueError, OSError, EOFError, KeyError, zipfile.BadZipFile, NotImplementedError) as error:
        if isinstance(error, RecordingError):
            raise
        raise RecordingError(f"{path} is a damaged NumPy file ({error}): write it again.") from error
    objects = [n for n, v in content.items() if v is None]
    columns, remarks = columns_of({n: v for n, v in content.items() if v is not None})
    if objects:
        remarks.append(f"passed over, being pickled objects: {', '.join(objects[:6])}")
    if not columns:
        raise RecordingError(f"{path} has no numeric array of ten or more rows: save the log's arrays.")
    return Log(path, "NumPy", tuple(columns), remarks=("read as a NumPy file", *remarks))


def _array(file, name: str) -> np.ndarray | None:
    try:
        return file[name]
    except ValueError as error:
        if "allow_pickle" in str(error):
            return None
        raise


def _header(stream) -> tuple[tuple[int, ...], bool, np.dtype]:
    version = npy.read_magic(stream)
    return npy.read_array_header_1_0(stream) if version == (1, 0) else npy.read_array_header_2_0(stream)


def read_parquet(path: Path, rows: tuple[int, int] | None = None) -> Log:
    """Return the numeric columns of a Parquet file; only ``rows`` (first, last), from 1, where given, without
    reading the others into memory."""
    try:
        with parquet.ParquetFile(path) as file:
            count = file.metadata.num_rows
            if rows is None:
                refuse_rows(path, count, "take a part with `haptic-teleop import --rows FIRST LAST`")
            start, stop = (0, count) if rows is None else (rows[0] - 1, min(rows[1], count))
            schema = file.schema_arrow
            kept = [f.name for f in schema if _kind(f.type)]
            passed = [f.name for f in schema if not _kind(f.type)]
            parts: list[pa.RecordBatch] = []
            before = 0
            for batch in file.iter_batches(1 << 16, columns=kept):
                low, high = max(start - before, 0), min(stop - before, len(batch))
                if high > low:
                    parts.append(batch.slice(low, high - low))
                before += len(batch)
                if before >= stop:
                    break
    except (pa.ArrowException, OSError) as error:
        raise RecordingError(
            f"{path} is a damaged or encrypted Parquet file ({error}): write it again, in plain."
        ) from error
    if not kept or not parts:
        raise RecordingError(f"{path} has no rows of numbers there: name another log, or other --rows.")
    table = pa.Table.from_batches(parts)
    columns = []
    for name in kept:
        field = schema.field(name)
        unit = (field.metadata or {}).get(b"unit", b"").decode("utf-8", "replace")
        instant = pa.types.is_timestamp(field.type) or pa.types.is_duration(field.type)
        columns.append(Column(name, _values(table[name]), "s" if instant else unit))
    remarks = ["read as a Parquet file"]
    if passed:
        remarks.append(f"passed over, being no numbers: {', '.join(passed[:6])}")
    return Log(path, "Parquet", tuple(columns), remarks=tuple(remarks))


def _kind(type_: pa.DataType) -> bool:
    t = pa.types
    return bool(
        t.is_integer(type_)
        or t.is_floating(type_)
        or t.is_boolean(type_)
        or t.is_decimal(type_)
        or t.is_timestamp(type_)
        or t.is_duration(type_)
    )


def _values(column: pa.ChunkedArray) -> np.ndarray:
    if pa.types.is_timestamp(column.type) or pa.types.is_duration(column.type):
        scale = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[column.type.unit]
        return scale * column.cast(pa.int64()).to_pandas().to_numpy(np.float64)
    # Whole numbers of more than 53 bits (nanoseconds since 1970) lose the last ones, as in any other format.
    return column.cast(pa.float64(), safe=False).to_pandas().to_numpy(np.float64)
