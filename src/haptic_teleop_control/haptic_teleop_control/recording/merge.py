"""Message records of several channels, merged by time into the contents of chunks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.recording.mcap_records import MESSAGE_HEAD
from haptic_teleop_control.recording.mcap_writer import Index

_HEAD = np.dtype(
    [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log", "<u8"),
        ("publish", "<u8"),
    ]
)
assert _HEAD.itemsize == MESSAGE_HEAD.size


class Stream(NamedTuple):
    """n messages of one channel: times of reception and publication in ns, (n,), and the messages as rows."""

    channel: int
    received: NDArray[np.int64]
    published: NDArray[np.int64]
    messages: NDArray[np.uint8]


def merged_chunks(
    streams: Sequence[Stream], chunk_bytes: int, chunk_ns: int
) -> Iterator[tuple[bytes, dict[int, Index]]]:
    """Chunk contents and their index, in the order of reception; none longer than ``chunk_bytes`` or
    ``chunk_ns``
    unless a single message is."""
    records = [_records(stream) for stream in streams]
    received = np.concatenate([stream.received for stream in streams])
    order = np.argsort(received, kind="stable")
    received = received[order]
    which = np.repeat(np.arange(len(streams)), [len(stream.received) for stream in streams])[order]
    row = np.concatenate([np.arange(len(stream.received)) for stream in streams])[order]
    sizes = np.array([one.dtype.itemsize for one in records])[which]
    ends = np.cumsum(sizes)
    starts = ends - sizes
    first = 0
    while first < len(order):
        by_time = np.searchsorted(received, received[first] + chunk_ns)
        by_size = np.searchsorted(ends, starts[first] + chunk_bytes, "right")
        last = max(first + 1, int(min(by_time, by_size)))
        span = slice(first, last)
        data = bytearray(int(ends[last - 1] - starts[first]))
        index: dict[int, Index] = {}
        for i, (stream, one) in enumerate(zip(streams, records, strict=True)):
            mine = np.flatnonzero(which[span] == i)
            if len(mine):
                offsets = (starts[span] - starts[first])[mine]
                # Each byte starts a window of one record, so that a record is copied in one piece.
                windows = np.ndarray((len(data) - one.dtype.itemsize + 1,), one.dtype, data, 0, (1,))
                windows[offsets] = one[row[span][mine]]
                index[stream.channel] = Index(
                    received[span][mine].astype(np.uint64), offsets.astype(np.uint64)
                )
        yield bytes(data), index
        first = last


def _records(stream: Stream) -> NDArray[np.void]:
    """The message records of a stream, one item each."""
    n, length = stream.messages.shape
    head = np.zeros(n, _HEAD)
    head["opcode"], head["length"], head["channel"] = 5, 22 + length, stream.channel
    head["sequence"] = np.arange(n)
    head["log"] = stream.received
    head["publish"] = np.maximum(stream.published, 0)
    whole = np.concatenate((head.view(np.uint8).reshape(n, -1), stream.messages), axis=1)
    return whole.view(f"V{whole.shape[1]}")[:, 0]
