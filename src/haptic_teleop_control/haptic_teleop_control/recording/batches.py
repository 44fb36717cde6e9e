"""Messages of one topic that were read together, as matrices."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.recording.expansion import Budget, Damaged, TooLarge, expand_message
from haptic_teleop_control.recording.joint_state_cdr import rows_of
from haptic_teleop_control.recording.mcap_records import MESSAGE_HEAD
from haptic_teleop_control.recording.mcap_scan import McapScan

LOG_TIME = 15  # offset of the log time in a message record


@dataclass(frozen=True)
class Batch:
    """``count`` messages of a topic. ``rows``: (which of them, their bytes as a matrix) by length;
    ``received`` (count,)
    ns. Without rows they are only counted. ``kind``: their type."""

    topic: str
    count: int
    rows: list[tuple[NDArray[np.intp], NDArray[np.uint8]]] | None = None
    received: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    kind: str = ""


def mcap_batches(scan: McapScan, select: Callable[[str, str], bool]) -> Iterator[Batch]:
    """The messages of an MCAP file, chunk by chunk and topic by topic."""
    for messages in scan:
        for number in np.unique(messages.channel):
            chosen = np.flatnonzero(messages.channel == number)
            channel, kind = scan.channels.get(int(number)), scan.type_of(int(number))
            if channel is None or kind is None:
                if channel is None:
                    scan.problems.append(
                        f"{len(chosen)} messages belong to channel {number}, which it does not describe"
                    )
                else:
                    yield Batch(channel.topic, len(chosen))
            elif not select(channel.topic, kind):
                yield Batch(channel.topic, len(chosen))
            else:
                received = np.empty(len(chosen), np.int64)
                rows = []
                for size in np.unique(messages.size[chosen]):
                    which = np.flatnonzero(messages.size[chosen] == size)
                    records = messages.rows(chosen[which])
                    received[which] = np.ascontiguousarray(records[:, LOG_TIME : LOG_TIME + 8]).view("<i8")[
                        :, 0
                    ]
                    rows.append((which, records[:, MESSAGE_HEAD.size :]))
                yield Batch(channel.topic, len(chosen), rows, received, kind)


def decompress_messages(batch: Batch, budget: Budget) -> Batch:
    """The batch of a rosbag2 recording whose messages are compressed one by one (compression mode
    "message"). Damaged, TooLarge as `expand_message`, naming the topic."""
    if batch.rows is None:
        return batch
    messages = [b""] * batch.count
    try:
        for which, matrix in batch.rows:
            for i, row in zip(which, matrix, strict=True):
                messages[i] = expand_message(row.tobytes(), budget)
    except TooLarge as refusal:
        raise TooLarge(f"a message on {batch.topic} {refusal}") from None
    except Damaged as damage:
        raise Damaged(f"a message on {batch.topic} is not taken: {damage}") from None
    return replace(batch, rows=rows_of(messages))
