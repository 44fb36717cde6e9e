"""sensor_msgs/JointState to and from CDR, thousands of messages at once.

Messages of equal layout are rows of one byte matrix, so stamps and values are columns of it and need no loop
over messages. A recording whose layout changes is decoded layout by layout.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.recording.cdr_layout import ENCAPSULATION, STAMP, Layout, find_layout
from haptic_teleop_control.recording.series import FIELDS, NANOSECONDS, JointStateSeries

Bytes = NDArray[np.uint8]
MAX_LAYOUTS = 256


def decode(messages: Sequence[bytes] | Bytes, received: NDArray[np.int64] | None = None) -> JointStateSeries:
    """The series held by serialised messages, a list or the rows of an (n, length) matrix.

    ``received`` (n,) ns defaults to the stamps. Joints take the order of the first message; a later message
    may order its names differently, change frame, or leave fields empty (NaN there). What cannot be taken as
    it is (no whole message, a joint that is missing or new, a field of another length than the names) is left
    out and told in ``problems``. No messages give an empty series.
    """
    n = len(messages)
    if isinstance(messages, np.ndarray):
        groups = [(np.arange(n), messages)] if n else []
    else:
        groups = rows_of(messages)
    return decode_groups(n, groups, received)


def decode_groups(
    n: int, groups: list[tuple[NDArray[np.intp], Bytes]], received: NDArray[np.int64] | None = None
) -> JointStateSeries:
    """As ``decode``, for n messages given as (which messages, their bytes as a matrix) by length."""
    parts, broken = _by_layout(groups)
    if not parts:
        empty = np.zeros(0, np.int64)
        return JointStateSeries(empty, empty, (), problems=_sentences(Counter(), broken, n))
    parts.sort(key=lambda part: part[0][0])
    first = parts[0][2]
    stamp = np.zeros(n, np.int64)
    values = {field: np.full((n, len(first.names)), np.nan) for field in FIELDS}
    seen: dict[str, int] = dict.fromkeys(FIELDS, 0)
    good = np.zeros(n, bool)
    problems: Counter[str] = Counter()
    for rows, matrix, layout in parts:
        good[rows] = True
        stamp[rows] = _stamps(matrix, layout)
        to, where = _match(first.names, layout.names, len(rows), problems)
        for field, (offset, count) in zip(FIELDS, layout.fields, strict=True):
            if count == 0:
                continue
            if count != len(layout.names):
                problems[f"{count} values of {field} for {len(layout.names)} joints: left out"] += len(rows)
                continue
            seen[field] += len(rows)
            block = np.ascontiguousarray(matrix[:, offset : offset + 8 * count]).view(layout.order + "f8")
            if len(parts) == 1 and len(rows) == n and layout.names == first.names:
                values[field] = block.astype(np.float64, copy=False)
            else:
                values[field][np.ix_(rows, np.array(to, np.intp))] = block[:, where]
    kept = int(good.sum())
    for field, number in seen.items():
        if 0 < number < kept:
            problems[f"no {field}: NaN there"] += kept - number
    arrived = stamp if received is None else np.asarray(received, np.int64)
    if kept < n:
        stamp, arrived = stamp[good], arrived[good]
        values = {field: array[good] for field, array in values.items()}
    position, velocity, effort = (values[field] if seen[field] else None for field in FIELDS)
    return JointStateSeries(
        stamp,
        arrived,
        first.names,
        position,
        velocity,
        effort,
        frame_id=first.frame_id,
        problems=_sentences(problems, broken, n),
    )


def encode(series: JointStateSeries) -> Bytes:
    """The messages of a series as an (n, length) matrix, one message (little-endian plain CDR) in each
    row."""
    head = bytearray(b"\0\1\0\0") + bytes(8)
    head += _string(series.frame_id)
    for text in (None, *series.names):
        head += bytes(-(len(head) - ENCAPSULATION) % 4)
        head += struct.pack("<I", len(series.names)) if text is None else _string(text)
    offsets: list[tuple[int, NDArray[np.float64]]] = []
    for field in FIELDS:
        array = getattr(series, field)
        count = 0 if array is None else array.shape[1]
        head += bytes(-(len(head) - ENCAPSULATION) % 4) + struct.pack("<I", count)
        if array is not None and count:
            head += bytes(-(len(head) - ENCAPSULATION) % 8)
            offsets.append((len(head), array))
            head += bytes(8 * count)
    n = len(series)
    matrix = np.repeat(np.frombuffer(bytes(head), np.uint8)[None, :], n, axis=0)
    seconds, nanoseconds = np.divmod(series.stamp, NANOSECONDS)
    matrix[:, STAMP : STAMP + 4] = seconds.astype("<i4")[:, None].view(np.uint8)
    matrix[:, STAMP + 4 : STAMP + 8] = nanoseconds.astype("<u4")[:, None].view(np.uint8)
    for offset, array in offsets:
        block = np.ascontiguousarray(array, "<f8").view(np.uint8)
        matrix[:, offset : offset + block.shape[1]] = block
    return matrix


def rows_of(messages: Sequence[bytes]) -> list[tuple[NDArray[np.intp], NDArray[np.uint8]]]:
    """Messages of any length as matrices, one for each length."""
    lengths = np.fromiter(map(len, messages), np.intp, len(messages))
    rows = []
    for length in np.unique(lengths):
        which = np.flatnonzero(lengths == length)
        chosen = messages if len(which) == len(messages) else [messages[int(i)] for i in which]
        rows.append((which, np.frombuffer(b"".join(chosen), np.uint8).reshape(len(which), length)))
    return rows


def _string(text: str) -> bytes:
    data = text.encode() + b"\0"
    return struct.pack("<I", len(data)) + data


def _stamps(matrix: Bytes, layout: Layout) -> NDArray[np.int64]:
    words = np.ascontiguousarray(matrix[:, STAMP : STAMP + 8])
    seconds = words[:, :4].copy().view(layout.order + "i4")[:, 0].astype(np.int64)
    return seconds * NANOSECONDS + words[:, 4:].copy().view(layout.order + "u4")[:, 0]


def _by_layout(
    groups: list[tuple[NDArray[np.intp], Bytes]],
) -> tuple[list[tuple[NDArray[np.intp], Bytes, Layout]], Counter[str]]:
    """Splits groups of equal length into groups of equal layout; counts messages that have none, by
    reason."""
    parts: list[tuple[NDArray[np.intp], Bytes, Layout]] = []
    broken: Counter[str] = Counter()
    for all_rows, all_bytes in groups:
        rows, matrix = all_rows, all_bytes
        while len(rows):
            try:
                if len(parts) >= MAX_LAYOUTS:
                    raise ValueError(f"more than {MAX_LAYOUTS} different layouts on one topic")
                layout = find_layout(matrix[0].tobytes())
            except ValueError as error:
                broken[str(error)] += 1
                rows, matrix = rows[1:], matrix[1:]
                continue
            same = np.all(matrix[:, layout.fixed] == matrix[0, layout.fixed], axis=1)
            if same.all():
                parts.append((rows, matrix, layout))
                break
            parts.append((rows[same], matrix[same], layout))
            rows, matrix = rows[~same], matrix[~same]
    return parts, broken


def _match(
    names: tuple[str, ...], others: tuple[str, ...], count: int, problems: Counter[str]
) -> tuple[list[int], list[int]]:
    """Columns of the series and columns of the message that hold the same joints."""
    if len(set(others)) < len(others):
        problems["a joint named twice: the first is taken"] += count
    if names == others:
        return list(range(len(names))), list(range(len(names)))
    if missing := [name for name in names if name not in others]:
        problems[f"no joint {', '.join(missing)}: NaN there"] += count
    if new := [name for name in others if name not in names]:
        problems[f"a joint {', '.join(new)} that the first has not: left out"] += count
    to = [i for i, name in enumerate(names) if name in others]
    return to, [others.index(names[i]) for i in to]


def _sentences(problems: Counter[str], broken: Counter[str], n: int) -> tuple[str, ...]:
    told = [f"{count} of {n} messages have {what}" for what, count in problems.items()]
    told += [f"{count} of {n} messages are left out: {reason}" for reason, count in broken.most_common(3)]
    if len(broken) > 3:
        rest = sum(count for _, count in broken.most_common()[3:])
        told.append(f"{rest} of {n} messages are left out for other reasons")
    return tuple(told)


def header_stamp(data: bytes) -> int:
    """ns, header.stamp of a serialised message that begins with a std_msgs/Header; 0 for data too short to
    hold one."""
    if len(data) < 12:
        return 0
    order = "<" if data[1] & 1 else ">"
    sec, nanosec = struct.unpack_from(f"{order}iI", data, 4)
    return sec * 1_000_000_000 + nanosec
