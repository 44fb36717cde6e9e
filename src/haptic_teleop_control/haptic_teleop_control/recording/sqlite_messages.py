"""The messages of a rosbag2 SQLite3 file."""

from __future__ import annotations

import sqlite3
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from haptic_teleop_control.recording.bag_files import SQLITE_MAGIC
from haptic_teleop_control.recording.batches import Batch
from haptic_teleop_control.recording.expansion import Budget, Damaged, TooLarge, expand_file
from haptic_teleop_control.recording.joint_state_cdr import rows_of

AT_ONCE = 20_000
SHORTEST_LIMIT = 1 << 20
"""Bytes; also a small file's schema must be read."""


@contextmanager
def opened(file: Path, budget: Budget) -> Iterator[sqlite3.Connection]:
    """A connection that only reads; Damaged when the file is no SQLite3 file or its tables are not stored
    ones, TooLarge when it is compressed as a whole and expands beyond `budget`."""
    with TemporaryDirectory() as scratch:
        if file.name.endswith(".zstd"):
            unpacked = Path(scratch) / file.stem
            with file.open("rb") as source, unpacked.open("wb") as target:
                expand_file(source, target, budget)
            file = unpacked
        try:
            # Immutable, so that reading writes no journal beside the recording and works on a read-only disk.
            # A log that a killed recorder left behind holds its last messages, and is seen only without that.
            immutable = int(not file.with_name(f"{file.name}-wal").exists())
            location = f"{file.resolve().as_uri()}?mode=ro&immutable={immutable}"
            connection = sqlite3.connect(location, uri=True)
        except sqlite3.Error as error:
            raise Damaged(f"it cannot be opened ({error})") from None
        try:
            # No value that is stored in the file is longer than the file.
            log = file.with_name(f"{file.name}-wal")
            stored = file.stat().st_size + (log.stat().st_size if log.exists() else 0)
            connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, max(SHORTEST_LIMIT, stored))
            _check_stored(connection)
            yield connection
        except sqlite3.Error as error:
            raise Damaged(f"it is damaged ({error})") from None
        finally:
            connection.close()


def missing_bytes(file: Path) -> int:
    """How many bytes the file lacks of the size that its head announces, which SQLite itself does not check.

    SQLite file format, header: page size at byte 16, number of pages at byte 28.
    """
    with file.open("rb") as stream:
        head = stream.read(32)
    if len(head) < 32 or not head.startswith(SQLITE_MAGIC):
        return 0
    page = int.from_bytes(head[16:18], "big")
    page = 65536 if page == 1 else page
    return max(0, page * int.from_bytes(head[28:32], "big") - file.stat().st_size)


def definitions(connection: sqlite3.Connection) -> defaultdict[str, tuple[str, str]]:
    """Encoding and text by message type, as recorders keep them since 2023; both empty for other types."""
    found: defaultdict[str, tuple[str, str]] = defaultdict(lambda: ("", ""))
    present = "SELECT count(*) FROM sqlite_master WHERE name = 'message_definitions'"
    if connection.execute(present).fetchone()[0]:
        _check_stored(connection, ("message_definitions",))
        cursor = connection.execute(
            "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
        )
        found.update({str(kind): (str(encoding), str(text)) for kind, encoding, text in cursor})
    return found


def _check_stored(connection: sqlite3.Connection, tables: Sequence[str] = ("topics", "messages")) -> None:
    """Damaged unless what is read are tables with stored columns: a view or a generated column can yield
    any amount of data from a few bytes, and never end."""
    for table in tables:
        schema = "SELECT type, sql FROM sqlite_master WHERE lower(name) = ?"
        stated = connection.execute(schema, (table,)).fetchall()
        generated = f"SELECT name FROM pragma_table_xinfo('{table}') WHERE hidden"
        computed = connection.execute(generated).fetchall()
        for kind, text in stated:
            if kind != "table" or "VIRTUAL" in str(text).upper().split() or computed:
                raise Damaged(
                    f"its {table} are computed, not stored, which no recorder does: record it with rosbag2"
                )


def batches(
    connection: sqlite3.Connection, select: Callable[[str, str], bool], budget: Budget
) -> Iterator[tuple[Batch, str]]:
    """The messages topic by topic with the type of the topic; sqlite3.Error where the file is damaged,
    TooLarge from `budget`."""
    topics = connection.execute("SELECT id, name, type FROM topics ORDER BY id").fetchall()
    for number, name, kind in topics:
        if not (isinstance(name, str) and isinstance(kind, str)):
            raise Damaged("a topic in it has no name or no type")
        if not select(name, kind):
            (count,) = connection.execute(
                "SELECT count(*) FROM messages WHERE topic_id = ?", (number,)
            ).fetchone()
            yield Batch(name, count), kind
            continue
        # By row number, not by time: that needs no index, and a damaged file still gives what lies before the
        # damage.
        cursor = connection.execute(
            "SELECT timestamp, data FROM messages WHERE topic_id = ? ORDER BY id", (number,)
        )
        damage: sqlite3.Error | None = None
        while damage is None:
            found, damage, ended = _fetch(cursor, budget)
            if found:
                received = np.array([time for time, _ in found], np.int64)
                rows = rows_of([data for _, data in found])
                yield Batch(name, len(found), rows, received, kind), kind
            if ended:
                break
        if damage:
            raise damage


def _fetch(
    cursor: sqlite3.Cursor, budget: Budget
) -> tuple[list[tuple[int, bytes]], sqlite3.Error | None, bool]:
    """The next rows, what stopped the reading of them, and whether they are the last."""
    found: list[tuple[int, bytes]] = []
    try:
        for row in cursor:
            if not (isinstance(row[0], int) and isinstance(row[1], bytes)):
                raise Damaged("a message in it is no bytes with a time")
            budget.take(len(row[1]))  # in a crafted file many rows share the same pages
            found.append(row)
            if len(found) == AT_ONCE:
                return found, None, False
    except TooLarge as refusal:
        raise TooLarge(f"it {refusal}") from None
    except sqlite3.Error as error:
        return found, error, True
    return found, None, True
