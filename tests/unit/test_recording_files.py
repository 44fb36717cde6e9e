"""Recordings written and read: by our writer, by rosbags and the mcap library, in every storage and
compression."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap.records import DataEnd
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType
from mcap.writer import Writer as LibraryWriter
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter
from rosbags.typesys import Stores, get_typestore

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_control.recording import (
    JointStateSeries,
    RecordingWriter,
    bag_problems,
    read_recording,
    write_recording,
)
from haptic_teleop_control.recording.definitions import message_definition
from haptic_teleop_control.recording.joint_state_cdr import encode
from haptic_teleop_control.recording.recover import main as recover

TYPE = "sensor_msgs/msg/JointState"
START = 1_700_000_000_000_000_000
MODES = (CompressionMode.STORAGE, CompressionMode.FILE, CompressionMode.MESSAGE)
STORE = get_typestore(Stores.ROS2_KILTED)


def series(n=2500, names=("stage1_motor", "stage1_arm"), seed=0, late=30_000):
    stamp = START + np.arange(n) * 1_000_000
    rng = np.random.default_rng(seed)
    return JointStateSeries(stamp, stamp + late, names, *(rng.normal(size=(n, len(names))) for _ in range(3)))


def topics():
    return {"/sfj/joint_states": series(), "/omni/joint_states": series(2000, ("omni_x",), 1, 50_000)}


def assert_equal(found, expected):
    assert found.names == expected.names
    for field in ("stamp", "received", "position", "velocity", "effort"):
        assert np.array_equal(getattr(found, field), getattr(expected, field)), field


def write_with_rosbags(path, data, storage=StoragePlugin.MCAP, mode=None):
    writer = RosbagsWriter(path, version=9, storage_plugin=storage)
    if mode is not None:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    writer.set_custom_data("haptic_teleop.experiment", '{"kind": "step"}')
    with writer:
        for topic, one in data.items():
            connection = writer.add_connection(topic, TYPE, typestore=STORE)
            for time, row in zip(one.received, encode(one), strict=True):
                writer.write(connection, int(time), row.tobytes())
    return path


def write_with_library(path, data, **options):
    with path.open("wb") as file:
        writer = LibraryWriter(file, **options)
        writer.start("ros2")
        schema = writer.register_schema(TYPE, "ros2msg", message_definition(TYPE)[0].encode())
        for topic, one in data.items():
            channel = writer.register_channel(topic, "cdr", schema)
            for time, row in zip(one.received, encode(one), strict=True):
                writer.add_message(channel, int(time), row.tobytes(), int(time))
        writer.finish()
    return path


@pytest.mark.parametrize("compression", ["", "zstd"])
def test_what_is_written_is_read_back(tmp_path, compression):
    data = topics()
    parameters = {"/sfj/sfj_sim": {"rate": 500.0}}
    path = write_recording(tmp_path / "a", data, parameters, {"kind": "step"}, compression=compression)
    recording = read_recording(path)
    assert recording.complete
    assert recording.problems == []
    assert recording.parameters == parameters
    assert recording.experiment == {"kind": "step"}
    assert recording.counts == {"/sfj/joint_states": 2500, "/omni/joint_states": 2000}
    for name, one in data.items():
        assert_equal(recording.topics[name], one)


def test_only_the_topics_asked_for_are_decoded_and_all_are_counted(tmp_path):
    path = write_recording(tmp_path / "a", topics())
    recording = read_recording(path, ["/omni/joint_states"])
    assert list(recording.topics) == ["/omni/joint_states"]
    assert recording.counts["/sfj/joint_states"] == 2500


@pytest.mark.parametrize(
    ("storage", "mode"),
    [
        *((StoragePlugin.MCAP, mode) for mode in (None, *MODES)),
        *((StoragePlugin.SQLITE3, mode) for mode in (None, CompressionMode.FILE, CompressionMode.MESSAGE)),
    ],
)
def test_bags_of_rosbags_are_read(tmp_path, storage, mode):
    data = topics()
    recording = read_recording(write_with_rosbags(tmp_path / "a", data, storage, mode))
    assert recording.complete, recording.problems
    assert recording.experiment == {"kind": "step"}
    for name, one in data.items():
        assert_equal(recording.topics[name], one)


@pytest.mark.parametrize(
    "options",
    [
        {"compression": CompressionType.NONE},
        {"compression": CompressionType.LZ4, "chunk_size": 10_000},
        {"compression": CompressionType.ZSTD, "enable_crcs": False},
        {"use_chunking": False},
        {
            "use_statistics": False,
            "use_summary_offsets": False,
            "repeat_channels": False,
            "repeat_schemas": False,
        },
    ],
)
def test_bare_files_of_the_mcap_library_are_read(tmp_path, options):
    data = topics()
    recording = read_recording(write_with_library(tmp_path / "a.mcap", data, **options))
    assert recording.complete, recording.problems
    for name, one in data.items():
        assert_equal(recording.topics[name], one)


def test_split_files_are_joined_in_the_order_of_time(tmp_path):
    one = series()
    cut = {"a_0.mcap": slice(0, 1000), "a_1.mcap": slice(1000, 1700), "a_2.mcap": slice(1700, None)}
    for name, part in cut.items():
        fields = (getattr(one, f)[part] for f in ("stamp", "received"))
        values = (getattr(one, f)[part] for f in ("position", "velocity", "effort"))
        write_with_library(tmp_path / name, {"/t": JointStateSeries(*fields, one.names, *values)})
    listed = ["a_2.mcap", "a_0.mcap", "a_1.mcap"]
    information = {"version": 9, "storage_identifier": "mcap", "relative_file_paths": listed}
    (tmp_path / "metadata.yaml").write_text(yaml.safe_dump({"rosbag2_bagfile_information": information}))
    recording = read_recording(tmp_path)
    assert recording.complete
    assert_equal(recording.topics["/t"], one)
    (tmp_path / "a_1.mcap").unlink()
    recording = read_recording(tmp_path)
    assert not recording.complete
    assert len(recording.topics["/t"]) == 1800
    assert "a_1.mcap" in recording.problems[0]


def test_rosbags_and_the_mcap_library_read_what_we_write(tmp_path):
    data = topics()
    path = write_recording(tmp_path / "a", data, {"/n": {}}, {"kind": "step"})
    with AnyReader([path]) as reader:  # no typestore: the definitions in the file must do
        assert reader.message_count == 4500
        seen = dict.fromkeys(data, 0)
        for connection, time, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            i = seen[connection.topic]
            seen[connection.topic] += 1
            if i % 500 == 0:
                expected = data[connection.topic]
                assert time == expected.received[i]
                assert tuple(message.name) == expected.names
                assert message.effort.tolist() == expected.effort[i].tolist()
        assert seen == {"/sfj/joint_states": 2500, "/omni/joint_states": 2000}
    with next(path.glob("*.mcap")).open("rb") as file:
        records = list(StreamReader(file, validate_crcs=True).records)  # raises where a checksum fails
    assert next(r for r in records if isinstance(r, DataEnd)).data_section_crc != 0
    with next(path.glob("*.mcap")).open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        messages = list(reader.iter_messages())
        schema = reader.get_summary().schemas[1]
        statistics = reader.get_summary().statistics
    assert len(messages) == statistics.message_count == 4500
    assert [m.log_time for _, _, m in messages] == sorted(m.log_time for _, _, m in messages)
    assert (schema.name, schema.encoding) == (TYPE, "ros2msg")


def test_definition_and_metadata_are_those_of_ros(tmp_path):
    text, rihs = message_definition(TYPE)
    assert text.splitlines()[:2] == ["std_msgs/Header header", "string[] name"]
    assert "MSG: std_msgs/Header" in text
    assert "MSG: builtin_interfaces/Time" in text
    # The hash as a recording of another origin has it.
    assert rihs == "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e"
    ours = yaml.safe_load((write_recording(tmp_path / "a", topics()) / "metadata.yaml").read_text())
    theirs = yaml.safe_load((write_with_rosbags(tmp_path / "b", topics()) / "metadata.yaml").read_text())
    assert _shape(ours) == _shape(theirs)


def _shape(content):
    """The keys of nested mappings, without those under custom data, which are free."""
    if isinstance(content, dict):
        return {key: _shape(value) for key, value in content.items() if key != "custom_data"}
    return [_shape(value) for value in content] if isinstance(content, list) else type(content)


def test_an_existing_directory_is_never_written_to(tmp_path):
    path = write_recording(tmp_path / "a", topics())
    before = {file.name: file.read_bytes() for file in path.iterdir()}
    with pytest.raises(RecordingError, match=r"a: it exists already.*name another output"):
        write_recording(path, topics())
    assert write_recording(path, topics(), numbered=True) == tmp_path / "a_2"
    assert write_recording(path, topics(), numbered=True) == tmp_path / "a_3"
    assert {file.name: file.read_bytes() for file in path.iterdir()} == before


def test_messages_written_one_by_one_are_the_same_recording(tmp_path):
    one = series()
    with RecordingWriter(tmp_path / "a", experiment={"kind": "x"}) as writer:
        for time, stamp, row in zip(one.received, one.stamp, encode(one), strict=True):
            writer.write("/t", TYPE, int(time), row.tobytes(), int(stamp))
        writer.describe(parameters={"/n": {"k": 1}})
    assert writer.counts == {"/t": 2500}
    recording = read_recording(tmp_path / "a")
    assert recording.complete
    assert (recording.parameters, recording.experiment) == ({"/n": {"k": 1}}, {"kind": "x"})
    assert_equal(recording.topics["/t"], one)


def test_messages_of_other_types_are_kept_and_counted(tmp_path):
    with RecordingWriter(tmp_path / "a") as writer:
        writer.write("/log", "std_msgs/msg/String", START, b"\0\1\0\0\2\0\0\0a\0")
        writer.write("/own", "lab_msgs/msg/Own", START, b"\0\1\0\0")
        writer.write_series({"/t": series(10)})
    recording = read_recording(tmp_path / "a")
    assert recording.counts == {"/log": 1, "/own": 1, "/t": 10}
    assert recording.types["/own"] == "lab_msgs/msg/Own"
    with AnyReader([tmp_path / "a"]) as reader:
        connection, _, raw = next(reader.messages([c for c in reader.connections if c.topic == "/log"]))
        assert reader.deserialize(raw, connection.msgtype).data == "a"
    with pytest.raises(RecordingError, match=r"'/log' holds std_msgs/msg/String: name a topic"):
        read_recording(tmp_path / "a", ["/log"])


def test_a_full_disk_is_one_sentence_and_leaves_a_recording_that_recover_can_use(tmp_path):
    import resource
    import signal

    one = series(20_000)
    previous = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1_500_000, limits[1]))
    try:
        sentence = r"a: cannot be written .*free space"
        with pytest.raises(RecordingError, match=sentence), RecordingWriter(tmp_path / "a") as writer:
            for time, row in zip(one.received, encode(one), strict=True):
                writer.write("/t", TYPE, int(time), row.tobytes())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, previous)
    assert recover([str(tmp_path / "a"), "--output", str(tmp_path / "b")]) in (0, 3)
    kept = read_recording(tmp_path / "b").topics["/t"]
    assert len(kept) >= 4000
    assert np.array_equal(kept.position, one.position[: len(kept)])


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda p: p / "nowhere", "there is no such file or directory: name a recording"),
        (lambda p: p, "it holds no recording .*: name a rosbag2 directory"),
        (lambda p: _file(p / "notes.txt", b"hello"), "it is no recording: name a rosbag2 directory"),
        (lambda p: _file(p / "empty.mcap", b""), r"no messages \(.*it is empty\)"),
        (lambda p: _file(p / "text.mcap", b"this is text, not a recording"), "it is not an MCAP file"),
        (lambda p: _file(p / "x.db3", b"this is text, not a recording" * 100), "file is not a database"),
        (lambda p: write_recording(p / "r" / "run1", topics()).parent, r"a folder of recordings: .*\(run1\)"),
        (lambda p: _without_data(write_recording(p / "r", topics())), "copy the .mcap files beside it"),
        (lambda p: write_recording(p / "r", {}), "it holds no messages"),
    ],
)
def test_what_is_no_recording_is_one_sentence_with_file_and_remedy(tmp_path, make, sentence):
    path = make(tmp_path)
    with pytest.raises(RecordingError, match=sentence) as caught:
        read_recording(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def _file(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


def _without_data(path: Path) -> Path:
    next(path.glob("*.mcap")).unlink()
    return path


def test_an_unknown_topic_is_refused_with_those_that_are_there(tmp_path):
    path = write_recording(tmp_path / "a", topics())
    with pytest.raises(
        RecordingError, match="'/x': it has joint states on /omni/joint_states, /sfj/joint_states"
    ):
        read_recording(path, ["/x"])
    with pytest.raises(RecordingError, match="'/x'"):
        read_recording(path).topic("/x")


@pytest.mark.parametrize("text", ["not: [valid", "rosbag2_bagfile_information: 3", "\0\1", "[]", ""])
def test_a_damaged_metadata_file_costs_the_description_and_no_message(tmp_path, text):
    path = write_recording(tmp_path / "a", topics(), {"/n": {"k": 1}}, {"kind": "step"})
    (path / "metadata.yaml").write_text(text)
    recording = read_recording(path)
    assert not recording.complete
    assert "metadata.yaml" in recording.problems[0]
    assert recording.counts["/sfj/joint_states"] == 2500
    assert recording.parameters == {"/n": {"k": 1}}  # from the copy in the file


def test_a_description_that_is_no_json_object_is_told_and_passed_over(tmp_path):
    path = write_recording(tmp_path / "a", topics(), {"/n": {"k": 1}})
    content = yaml.safe_load((path / "metadata.yaml").read_text())
    content["rosbag2_bagfile_information"]["custom_data"]["haptic_teleop.parameters"] = json.dumps([1])
    (path / "metadata.yaml").write_text(yaml.safe_dump(content))
    recording = read_recording(path)
    assert recording.parameters == {}
    assert any("haptic_teleop.parameters is no JSON object" in p for p in recording.problems)


def test_the_sample_recordings_are_whole_and_even(shared_data):
    paths = sorted(path.parent for path in shared_data.glob("*/*/*/metadata.yaml"))
    assert paths
    for path in paths:
        recording = read_recording(path)
        assert recording.complete, recording.problems
        assert recording.experiment["kind"]
        for name, one in recording.topics.items():
            assert bag_problems(one, name).problems == ()


def test_what_a_recording_says_of_itself_is_json_for_any_reader(tmp_path):
    """`Infinity`, which Python writes, is no JSON: other readers refuse the whole of it."""
    parameters = {"/sfj/sfj_sim": {"wall": math.inf, "below": [-math.inf, 0.5], "none": math.nan, "on": True}}
    write_recording(tmp_path / "bag", topics(), parameters)
    text = yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_text())
    text = text["rosbag2_bagfile_information"]["custom_data"]["haptic_teleop.parameters"]

    def refused(word):
        raise AssertionError(f"{word} is no JSON")

    json.loads(text, parse_constant=refused)
    read = read_recording(tmp_path / "bag").parameters["/sfj/sfj_sim"]
    assert read["wall"] == math.inf and read["below"] == [-math.inf, 0.5]
    assert math.isnan(read["none"]) and read["on"] is True
