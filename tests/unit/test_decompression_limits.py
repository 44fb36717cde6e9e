"""Small files that expand hugely are refused in a sentence, before the memory or the disk is full."""

import re
import sqlite3
import subprocess
import sys
import zlib
from functools import cache
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import yaml
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import Chunk, DataEnd, Footer
from mcap.stream_reader import StreamReader
from rosbags.rosbag1 import Writer as Writer1
from rosbags.typesys import Stores, get_typestore

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_control.raw_capture import READ, RawCapture, read_capture
from haptic_teleop_control.recording import JointStateSeries, RecordingWriter, read_recording, write_recording
from haptic_teleop_control.recording.expansion import FILE_BYTES, PART_BYTES, RATIO
from haptic_teleop_control.recording.joint_state_cdr import encode
from haptic_teleop_control.recording.recover import main as recover

MAGIC = b"\x89MCAP0\r\n"
TYPE = "sensor_msgs/msg/JointState"
START = 1_700_000_000_000_000_000
HUGE = 900 << 20
"""Bytes; more than the peak allowed below by far, and less than a chunk may have at all."""
ROOM = 350 << 20
"""Bytes that the reading process may have at its peak; the libraries alone take about 100 MB."""


def series(n=60):
    stamp = START + np.arange(n) * 50_000_000
    return JointStateSeries(stamp, stamp + 1000, ("j",), np.arange(n, dtype=float)[:, None])


@cache
def zeros(compression: str, size: int) -> bytes:
    """`size` zeros, compressed without ever being in memory, and without telling their number; kept, because
    they take seconds and are used by many."""
    if compression == "bz2":  # as `head -c 900M /dev/zero | bzip2` makes them in ten seconds
        assert size == HUGE
        return (Path(__file__).parents[1] / "data" / "zeros_900_mib.bz2").read_bytes()
    lz = lz4.frame.LZ4FrameCompressor()
    packer = zstandard.ZstdCompressor().compressobj() if compression == "zstd" else lz
    parts = [lz.begin()] if compression == "lz4" else []
    block = bytes(1 << 20)
    parts += [packer.compress(block) for _ in range(size >> 20)]
    return b"".join([*parts, packer.flush()])


def bomb(compression: str, size: int, announced: int | None = None) -> Chunk:
    times = {"message_start_time": START, "message_end_time": START + 10**9}
    told = {"uncompressed_crc": 0, "uncompressed_size": size if announced is None else announced}
    return Chunk(compression=compression, data=zeros(compression, size), **told, **times)


def with_chunks(file: Path, chunks: list[Chunk]) -> None:
    """Puts `chunks` behind everything else in an MCAP file."""
    with file.open("rb") as stream:
        records = list(StreamReader(stream, emit_chunks=True).records)
    end = next(i for i, record in enumerate(records) if isinstance(record, DataEnd))
    builder = RecordBuilder()
    for record in [*records[:end], *chunks, DataEnd(0), Footer(0, 0, 0)]:
        record.write(builder)
    file.write_bytes(MAGIC + builder.end() + MAGIC)


def huge_ros1_bag(path: Path, compression: str, announced: int) -> None:
    """A bag of ROS 1 with one chunk that is no more than HUGE zeros."""
    packed = zeros(compression, HUGE)
    store = get_typestore(Stores.ROS1_NOETIC)
    writer = Writer1(path)
    writer.compression_format, writer.compressor = compression, lambda _: packed
    with writer:
        writer.write(writer.add_connection("/big", "std_msgs/msg/String", typestore=store), START, bytes(4))
    data = path.read_bytes()
    size = data.index(b"size=", data.index(b"compression=")) + 5
    path.write_bytes(data[:size] + announced.to_bytes(4, "little") + data[size + 4 :])


def small_bag(path: Path) -> Path:
    write_recording(path, {"/t": series()}, {"/n": {"k": 1}}, {"kind": "x"})
    return next(path.glob("*.mcap"))


def peak(code: str, *arguments: object) -> tuple[str, int]:
    """What `code` prints, on both streams, and the most memory that it had, bytes."""
    # By its own account: what the system says of a child includes the memory of its parent, before `exec`.
    command = [sys.executable, "-c", code + ACCOUNT, *map(str, arguments)]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=True)
    told, _, memory = done.stdout.rpartition("peak kB ")
    return told, int(memory) * 1024


ACCOUNT = """
import re
from pathlib import Path
print("peak kB", re.search(r"VmHWM:\\s+(\\d+) kB", Path("/proc/self/status").read_text())[1])
"""
READING = """
import sys
from haptic_teleop_control.errors import RecordingError
from haptic_teleop_control.recording import read_recording
try:
    recording = read_recording(sys.argv[1])
    print({name: len(one) for name, one in recording.topics.items()}, recording.complete)
    print("\\n".join(recording.problems))
except RecordingError as refusal:
    print("refused:", refusal)
"""
RECOVERING = """
import sys
from haptic_teleop_control.recording.recover import main
print("status", main([sys.argv[1], "--output", sys.argv[2]]))
"""


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_a_chunk_that_expands_hugely_is_left_out_by_reading_and_by_recover_and_the_rest_is_kept(
    tmp_path, compression
):
    file = small_bag(tmp_path / "bag")
    with_chunks(file, [bomb(compression, HUGE)])
    assert file.stat().st_size < HUGE / 200
    told, memory = peak(READING, file.parent)
    assert "{'/t': 60} False" in told
    (sentence,) = (line for line in told.splitlines() if "chunk 4" in line)
    assert str(file) in sentence and "944 MB" in sentence and "rewrite the recording" in sentence
    assert memory < ROOM
    told, memory = peak(RECOVERING, file, tmp_path / "new")
    assert "status 3" in told and "chunk 4" in told and memory < ROOM
    assert len(read_recording(tmp_path / "new").topics["/t"]) == 60


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_a_chunk_that_holds_more_than_it_announces_is_left_out_at_that_size(tmp_path, compression):
    file = small_bag(tmp_path / "bag")
    with_chunks(file, [bomb(compression, HUGE, announced=1000)])
    told, memory = peak(READING, file.parent)
    assert "it holds more than the 1000 bytes that it announces" in told and memory < ROOM


def test_chunks_that_are_each_small_enough_are_taken_until_the_file_has_expanded_enough(tmp_path):
    file = small_bag(tmp_path / "bag")
    size = PART_BYTES
    with_chunks(file, [bomb("zstd", size)] * (FILE_BYTES // size + 3))
    told, memory = peak(READING, file.parent)
    # Three chunks of the recording's own are not compressed, and do not count.
    (sentence,) = (line for line in told.splitlines() if "1.07e+03 MB" in line)
    assert f"chunk {3 + FILE_BYTES // size + 1} at byte" in sentence
    assert sentence.endswith("the rest is left out")
    assert "{'/t': 60} False" in told and memory < ROOM


def test_a_recording_that_is_nothing_but_a_bomb_is_one_error_that_names_chunk_and_file(tmp_path):
    file = small_bag(tmp_path / "bag")
    with file.open("rb") as stream:
        records = list(StreamReader(stream, emit_chunks=True).records)
    builder = RecordBuilder()
    kept = [record for record in records if not isinstance(record, (Chunk, DataEnd, Footer))]
    for record in [*kept, bomb("zstd", HUGE), DataEnd(0), Footer(0, 0, 0)]:
        record.write(builder)
    file.write_bytes(MAGIC + builder.end() + MAGIC)
    with pytest.raises(RecordingError, match=r"bag_0\.mcap: chunk 1 at byte \d+.* would expand to 944 MB"):
        read_recording(file)


@pytest.mark.parametrize("announced", [False, True])
def test_a_file_compressed_as_a_whole_is_refused_before_it_fills_memory_or_disk(
    tmp_path, announced, monkeypatch
):
    packed = tmp_path / "bag_0.mcap.zstd"
    data = zeros("zstd", FILE_BYTES + (64 << 20))
    if announced:  # a frame header that says 2^40 bytes; what follows does not matter
        data = b"\x28\xb5\x2f\xfd\xe0" + (1 << 40).to_bytes(8, "little") + data[6:]
    packed.write_bytes(data)
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setenv("TMPDIR", str(scratch))
    told, memory = peak(READING, packed)
    assert told.startswith("refused:") and f"{packed}: it would make more than 1.07e+03 MB" in told
    assert memory < ROOM and not list(scratch.iterdir())
    assert recover([str(packed), "--output", str(tmp_path / "new")]) == 1
    assert not (tmp_path / "new").exists()


def test_a_sqlite_file_compressed_as_a_whole_is_refused_likewise(tmp_path, monkeypatch):
    packed = tmp_path / "bag_0.db3.zstd"
    packed.write_bytes(zeros("zstd", FILE_BYTES + (64 << 20)))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with pytest.raises(RecordingError, match=r"bag_0\.db3\.zstd: it would make more than"):
        read_recording(packed)


def test_a_message_that_expands_hugely_is_refused_by_reading_and_left_out_by_recover(tmp_path):
    rows = [zstandard.ZstdCompressor().compress(row.tobytes()) for row in encode(series(3))]
    with RecordingWriter(tmp_path / "made") as writer:
        for k, row in enumerate([*rows[:2], zeros("zstd", HUGE), rows[2]]):
            writer.write("/t", TYPE, START + k, row)
    made = tmp_path / "made"
    described = yaml.safe_load((made / "metadata.yaml").read_text())
    described["rosbag2_bagfile_information"] |= {"compression_mode": "MESSAGE", "compression_format": "zstd"}
    (made / "metadata.yaml").write_text(yaml.safe_dump(described))
    told, memory = peak(READING, made)
    assert "a message on /t is not taken: its" in told and "made_0.mcap" in told and memory < ROOM
    told, memory = peak(RECOVERING, made, tmp_path / "new")
    assert "status 3" in told and "a message on /t is left out" in told and memory < ROOM
    assert len(read_recording(tmp_path / "new").topics["/t"]) == 3


def test_a_capture_with_a_chunk_that_expands_hugely_ends_before_it(tmp_path):
    path = tmp_path / "session.mcap"
    capture = RawCapture(path, "sfj", {})
    capture.add(READ, 1, b"sample")
    capture.close()
    with_chunks(path, [bomb("zstd", HUGE)])
    found = read_capture(path, "sfj")
    assert [packet.data for packet in found.packets] == [b"sample"] and not found.complete
    assert "chunk 2" in found.problem and "944 MB" in found.problem
    code = (
        "import sys; from haptic_teleop_control.raw_capture import read_capture as r; r(sys.argv[1], 'sfj')"
    )
    told, memory = peak(code, path)
    assert not told and memory < ROOM


TABLES = (
    "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT)",
    f"INSERT INTO topics VALUES (1, '/t', '{TYPE}')",
)
ENDLESS = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i+1 FROM n) SELECT i, 1, i, zeroblob(99) FROM n"
COLUMNS = "id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER"


@pytest.mark.parametrize(
    ("statements", "told"),
    [
        ([f"CREATE VIEW Messages(id, topic_id, timestamp, data) AS {ENDLESS}"], "computed, not stored"),
        (
            [
                f"CREATE TABLE messages({COLUMNS}, data BLOB AS (zeroblob(900000000)))",
                "INSERT INTO messages VALUES (1, 1, 1)",
            ],
            "computed, not stored",
        ),
        (
            [f"CREATE TABLE messages({COLUMNS}, data)", "INSERT INTO messages VALUES (1, 1, 1, 900000000)"],
            "no bytes with a time",
        ),
        (
            [f"CREATE TABLE messages({COLUMNS}, data)", "INSERT INTO messages VALUES (1, 1, 1, 'text')"],
            "no bytes with a time",
        ),
    ],
    ids=["endless view", "generated column", "a number for bytes", "a text for bytes"],
)
def test_a_sqlite_file_whose_messages_are_not_stored_bytes_is_refused(tmp_path, statements, told):
    file = tmp_path / "bag_0.db3"
    with sqlite3.connect(file) as connection:
        for statement in (*TABLES, *statements):
            connection.execute(statement)
    connection.close()
    printed, memory = peak(READING, file)
    assert f"{file}: " in printed and told in printed and memory < ROOM


def test_recordings_that_compress_very_well_are_read(tmp_path):
    """A robot at rest: the same numbers all the time."""
    n = 200_000
    stamp = START + np.arange(n) * 1_000_000
    still = np.zeros((n, 4))
    one = JointStateSeries(stamp, stamp, ("a", "b", "c", "d"), still, still, still)
    path = write_recording(tmp_path / "bag", {"/t": one}, compression="zstd")
    recording = read_recording(path)
    assert recording.complete and len(recording.topics["/t"]) == n
    file = next(path.glob("*.mcap"))
    assert n * 4 * 3 * 8 / file.stat().st_size < RATIO / 3, (
        "what a recorder writes stays well below the limit"
    )
    with file.open("rb") as stream:
        for record in StreamReader(stream, emit_chunks=True).records:
            if isinstance(record, Chunk):
                data = zstandard.ZstdDecompressor().decompress(record.data, record.uncompressed_size)
                assert zlib.crc32(data) == record.uncompressed_crc


IMPORTING = """
import sys
from pathlib import Path
from haptic_teleop_control.errors import RecordingError
from haptic_teleop_sysid.logs.reading import read_log
try:
    print({one.name: len(one.values) for one in read_log(Path(sys.argv[1])).columns})
except RecordingError as refusal:
    print("refused:", refusal)
"""
IMPORT_ROOM = 500 << 20
"""Bytes; as ROOM, with pandas and what else reads logs."""


@pytest.mark.parametrize("compression", ["bz2", "lz4"])
@pytest.mark.parametrize(
    ("announced", "sentence"),
    [(HUGE, "would expand to 944 MB"), (1000, "it holds more than the 1000 bytes that it announces")],
)
def test_import_refuses_a_bag_of_ros_1_with_a_chunk_that_expands_hugely(
    tmp_path, compression, announced, sentence
):
    path = tmp_path / "log.bag"
    huge_ros1_bag(path, compression, announced)
    assert path.stat().st_size < HUGE / 100
    told, memory = peak(IMPORTING, path)
    assert told.startswith("refused:") and str(path) in told and sentence in told
    assert memory < IMPORT_ROOM


def test_import_refuses_ros_2_bags_that_expand_hugely(tmp_path):
    file = small_bag(tmp_path / "bag")
    with_chunks(file, [bomb("zstd", HUGE)])
    folder = tmp_path / "packed"
    folder.mkdir()
    (folder / "bag_0.db3.zstd").write_bytes(zeros("zstd", FILE_BYTES + (64 << 20)))
    for path, sentence in ((file, "would expand to 944 MB"), (file.parent, "944 MB"), (folder, "more than")):
        told, memory = peak(IMPORTING, path)
        assert told.startswith("refused:") and sentence in told and memory < IMPORT_ROOM


def test_recordings_are_decompressed_in_one_place():
    """What the libraries read by themselves, they decompress without limit."""
    packages = Path(read_recording.__code__.co_filename).parents[3]
    files = list(packages.glob("haptic_teleop_*/haptic_teleop_*/**/*.py"))
    assert len({file.relative_to(packages).parts[0] for file in files}) == 5
    for file in files:
        text = file.read_text()
        if file.name != "expansion.py":
            assert "Decompressor" not in text and "rosbags.rosbag2" not in text, file
            assert "mcap.reader" not in text and "rosbags.highlevel" not in text, file
            assert "StreamReader(" not in text or "emit_chunks=True" in text, file
            assert "rosbags.rosbag1" not in text or "decompressor=lambda stored: expand_chunk(" in text, file
            assert not re.search(r"(import|from) (bz2|lz4|lzma)", text), file
