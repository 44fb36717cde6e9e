"""Damaged recordings: whole messages are returned, the loss is told, nothing altered passes, no traceback."""

import os
import subprocess
import sys

import numpy as np
import pytest
from message_series import SECOND, START, TYPE, series

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_control.recording import RecordingWriter, read_recording, write_recording
from haptic_teleop_control.recording.joint_state_cdr import encode
from haptic_teleop_control.recording.recover import main as recover


def small_bag(path, compression=""):
    """Three chunks of a second, 20 messages each; the content of the file."""
    write_recording(path, {"/t": series(60)}, {"/n": {"k": 1}}, {"kind": "x"}, compression=compression)
    return next(path.glob("*.mcap"))


def read(file):
    """Position and stamp that are found, and the recording; None where it is refused."""
    try:
        recording = read_recording(file)
    except RecordingError as refusal:
        assert "\n" not in str(refusal)
        assert str(file) in str(refusal)
        return None
    return recording


def assert_only_true_messages(recording):
    one = recording.topics["/t"]
    numbers = one.position[:, 0] - 0.25
    assert np.array_equal(one.stamp, START + (numbers * (SECOND // 20)).astype(np.int64))
    assert (np.diff(numbers) > 0).all()
    return len(one)


@pytest.mark.parametrize("compression", ["", "zstd"])
def test_a_file_cut_anywhere_gives_its_whole_messages_and_says_that_it_is_cut(tmp_path, compression):
    whole = small_bag(tmp_path / "a", compression).read_bytes()
    file = tmp_path / "cut.mcap"
    counts = []
    for length in [*range(compression == "zstd", len(whole), 13), len(whole) - 1]:
        file.write_bytes(whole[:length])
        recording = read(file)
        if recording is None:
            counts.append(0)
            continue
        assert not recording.complete
        assert recording.problems
        counts.append(assert_only_true_messages(recording))
    assert counts == sorted(counts)
    assert counts[-1] == 60
    # What is lost is the chunk in which the cut lies, or less.
    assert {0, 20, 40, 60} <= set(counts)


@pytest.mark.parametrize("compression", ["", "zstd"])
def test_no_flipped_byte_lets_an_altered_message_through(tmp_path, compression):
    whole = small_bag(tmp_path / "a", compression).read_bytes()
    file = tmp_path / "flipped.mcap"
    lossless = 0
    for at in range(compression == "zstd", len(whole), 13):
        file.write_bytes(whole[:at] + bytes([whole[at] ^ (1 << at % 8)]) + whole[at + 1 :])
        recording = read(file)
        if recording is None:
            continue
        count = assert_only_true_messages(recording)
        if count < 60:
            assert not recording.complete
            assert recording.problems
            assert count >= 20, at
        lossless += count == 60
    assert lossless > 0


def test_a_chunk_that_fails_its_checksum_is_left_out_and_named_with_its_time(tmp_path):
    file = small_bag(tmp_path / "a")
    content = bytearray(file.read_bytes())
    at = content.index(np.float64(30.25).tobytes())
    content[at] ^= 1
    file.write_bytes(content)
    recording = read_recording(file.parent)
    assert not recording.complete
    assert any("chunk 2" in p and "1.000 to 1.950 s" in p and "checksum" in p for p in recording.problems)
    assert recording.lost == [(START + SECOND + 1000, START + SECOND * 195 // 100 + 1000)]
    kept = recording.topics["/t"].position[:, 0]
    assert kept.tolist() == [i + 0.25 for i in [*range(20), *range(40, 60)]]


def test_a_file_of_zeros_behind_whole_chunks_gives_the_chunks(tmp_path):
    file = small_bag(tmp_path / "a")
    content = file.read_bytes()
    third = content.index(np.float64(40.25).tobytes())
    file.write_bytes(content[: third - 500] + bytes(4096))
    recording = read_recording(file)
    assert not recording.complete
    assert assert_only_true_messages(recording) >= 20


def test_a_damaged_sqlite_bag_gives_what_can_be_read(tmp_path):
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    one = series(3000)
    with Writer(tmp_path / "a", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connection = writer.add_connection("/t", TYPE, typestore=get_typestore(Stores.ROS2_KILTED))
        for received, row in zip(one.received, encode(one), strict=True):
            writer.write(connection, int(received), row.tobytes())
    file = next((tmp_path / "a").glob("*.db3"))
    whole = file.read_bytes()
    for length in [*range(0, len(whole), len(whole) // 40), len(whole) - 1]:
        file.write_bytes(whole[:length])
        recording = read(tmp_path / "a")
        if recording is not None:
            assert not recording.complete
            assert_only_true_messages(recording)


def test_a_missing_metadata_file_is_told(tmp_path):
    file = small_bag(tmp_path / "a")
    (file.parent / "metadata.yaml").unlink()
    recording = read_recording(file.parent)
    assert len(recording.topics["/t"]) == 60
    assert not recording.complete
    assert "metadata.yaml: it is missing" in recording.problems[0]
    assert "recover" in recording.problems[0]
    assert recording.parameters == {"/n": {"k": 1}}


WRITER = f"""
import sys, time
from message_series import series
from haptic_teleop_control.recording.joint_state_cdr import encode
from haptic_teleop_control.recording import RecordingWriter
one = series(2000)
about = {{"parameters": {{"/n": {{"k": 1}}}}, "experiment": {{"kind": "x"}}}}
writer = RecordingWriter(sys.argv[1], **about, durable=True)
for i, (received, row) in enumerate(zip(one.received, encode(one))):
    writer.write("/t", "{TYPE}", int(received), row.tobytes())
    if i == 1990:
        print("written", flush=True)
        time.sleep(60)
"""


def test_a_killed_writer_loses_at_most_a_second_and_recover_makes_it_whole(tmp_path, capsys):
    path = tmp_path / "killed"
    places = [os.path.dirname(__file__), *sys.path]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in places if p)}
    command = [sys.executable, "-c", WRITER, str(path)]
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE) as process:
        assert process.stdout.readline() == b"written\n"
        process.kill()
    before = {file.name: file.read_bytes() for file in path.iterdir()}
    recording = read_recording(path)
    assert not recording.complete
    assert recover([str(path)]) == 3
    assert "messages recovered" in capsys.readouterr().out
    assert {file.name: file.read_bytes() for file in path.iterdir()} == before
    recovered = read_recording(tmp_path / "killed_recovered")
    assert recovered.complete, recovered.problems
    assert (recovered.parameters, recovered.experiment) == ({"/n": {"k": 1}}, {"kind": "x"})
    assert len(recovered.topics["/t"]) >= 1990 - 20  # 20 messages are a second
    assert assert_only_true_messages(recovered) == len(recording.topics["/t"])


def test_recover_says_whole_lossy_nothing_or_bad_arguments_by_its_status(tmp_path, capsys):
    file = small_bag(tmp_path / "a")
    assert recover([str(file.parent)]) == 0
    assert len(read_recording(tmp_path / "a_recovered").topics["/t"]) == 60
    assert recover([str(file.parent)]) == 2  # the output exists
    assert recover([str(file.parent), "--output", str(file.parent / "inside")]) == 2
    (file.parent / "metadata.yaml").unlink()
    assert recover([str(file), "--output", str(tmp_path / "b")]) == 0  # nothing but metadata.yaml was missing
    file.write_bytes(file.read_bytes()[:4000])
    assert recover([str(file), "--output", str(tmp_path / "c")]) == 3
    file.write_bytes(file.read_bytes()[:100])
    assert recover([str(file), "--output", str(tmp_path / "d")]) == 1
    assert not (tmp_path / "d").exists()
    assert recover([str(tmp_path / "nowhere"), "--output", str(tmp_path / "e")]) == 2
    assert recover(["--nonsense"]) == 2
    assert "nothing to recover" in capsys.readouterr().err


def test_the_help_of_recover_tells_the_statuses(capsys):
    assert recover(["--help"]) == 0
    text = capsys.readouterr().out
    for line in ("0  the recording was whole", "3  something was lost", "1  nothing could be recovered"):
        assert line in text


def test_the_writer_hands_over_a_chunk_at_least_every_second(tmp_path):
    one = series(100)
    steady = [7 * SECOND]
    writer = RecordingWriter(tmp_path / "a", steady=lambda: steady[0])
    for i, (received, row) in enumerate(zip(one.received, encode(one), strict=True)):
        writer.write("/t", TYPE, int(received), row.tobytes())
        if i == 79:
            break
    assert len(read_recording(tmp_path / "a").topics["/t"]) == 60
    steady[0] += SECOND - 1
    writer.flush_older()
    assert len(read_recording(tmp_path / "a").topics["/t"]) == 60
    steady[0] += 1  # whatever a wall clock that was set back says
    writer.flush_older()
    assert len(read_recording(tmp_path / "a").topics["/t"]) == 80
    writer.close()
