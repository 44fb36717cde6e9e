"""Logs of every kind give back what was put into them, and say in one sentence what they cannot give."""

import os
import signal
import sqlite3
import struct
import zipfile
import zlib
from pathlib import Path

import h5py
import matio
import numpy as np
import pandas as pd
import pytest
import scipy.io
from joint_logs import HEADER, plain_table, table
from log_bags import ANGLE, SPEED, TORQUE, T, bag
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from haptic_teleop_control.errors import ConfigurationError, RecordingError
from haptic_teleop_sysid.logs.dialect import Stated
from haptic_teleop_sysid.logs.isolated import read_isolated
from haptic_teleop_sysid.logs.matlab import announced_bytes
from haptic_teleop_sysid.logs.reading import ReadOptions, read_log

DATA = (T, TORQUE, ANGLE)


def assert_holds(log, columns, digits=9):
    assert len(log.columns) == len(columns)
    for found, expected in zip(log.columns, columns, strict=True):
        assert np.allclose(found.values, expected, rtol=10.0 ** (1 - digits), atol=1e-12), found.name


@pytest.mark.parametrize("delimiter", [",", ";", "\t", " ", "|"])
@pytest.mark.parametrize("header", [("t", "u", "q"), ()])
def test_a_table_is_read_whatever_stands_between_its_cells(tmp_path, delimiter, header):
    log = read_log(table(tmp_path / "log", header, DATA, delimiter))
    assert_holds(log, DATA)
    assert [c.name for c in log.columns] == list(header or ("1", "2", "3"))


@pytest.mark.parametrize("delimiter", [";", "\t", " "])
def test_a_decimal_comma_is_seen(tmp_path, delimiter):
    log = read_log(table(tmp_path / "log.csv", ("t", "u", "q"), DATA, delimiter, ","))
    assert_holds(log, DATA)
    assert "decimal comma" in log.remarks[0]


def test_lines_above_the_header_and_a_row_of_units_are_told_from_the_table(tmp_path):
    lines = ["Logger 3.2", "Operator: nobody", "t;u;q"]
    log = read_log(table(tmp_path / "log.csv", ("s", "Nm", "deg"), DATA, ";", lines=lines))
    assert [(c.name, c.stated) for c in log.columns] == [("t", "s"), ("u", "Nm"), ("q", "deg")]
    assert "2 lines that were passed over" in log.remarks[0]


def test_a_commented_header_as_of_numpy_is_one(tmp_path):
    np.savetxt(tmp_path / "log.txt", np.column_stack(DATA), header="t u q")
    log = read_log(tmp_path / "log.txt")
    assert [c.name for c in log.columns] == ["t", "u", "q"]
    assert_holds(log, DATA)


def test_a_delimiter_behind_the_last_cell_makes_no_column(tmp_path):
    path = table(tmp_path / "log.csv", ("t", "u", "q"), DATA)
    lines = path.read_text().splitlines()
    path.write_text("\n".join([lines[0], *(line + "," for line in lines[1:])]))
    assert_holds(read_log(path), DATA)


@pytest.mark.parametrize("encoding", ["utf-16", "cp1252", "utf-8-sig"])
def test_encodings_of_other_systems_are_read(tmp_path, encoding):
    path = table(tmp_path / "log.csv", ("Zeit", "Moment", "Winkel °"), DATA, ";", ",")
    path.write_bytes(path.read_text(encoding="utf-8").encode(encoding))
    log = read_log(path)
    assert log.columns[2].name == "Winkel °"
    assert_holds(log, DATA)


def test_dates_with_times_become_seconds(tmp_path):
    when = pd.Timestamp("2026-03-01T10:00:00") + pd.to_timedelta(T, unit="s")
    pd.DataFrame({"when": when.map(lambda w: w.isoformat()), "q": ANGLE}).to_csv(
        tmp_path / "log.csv", index=False
    )
    values = read_log(tmp_path / "log.csv").columns[0].values
    assert np.allclose(values - values[0], T, atol=1e-6)
    assert values[0] == pytest.approx(1772359200.0)


def test_what_is_said_of_a_table_goes_before_what_is_seen(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("".join(f"{i},5;{i},25\n" for i in range(20)))
    seen, said = read_log(path), read_log(path, ReadOptions(Stated(",", ".", False)))
    assert len(seen.columns) == 2 and seen.columns[1].values[1] == 1.25
    assert len(said.columns) == 3


def test_only_some_rows_of_a_table_are_read(tmp_path):
    log = read_log(plain_table(tmp_path / "log.csv"), ReadOptions(rows=(101, 150)))
    assert np.array_equal(log.columns[0].values, 2.0 * np.arange(100, 150))


def test_a_last_line_that_was_not_finished_is_left_out_and_told(tmp_path):
    path = plain_table(tmp_path / "log.csv")
    path.write_text(path.read_text() + "3000,12")
    log = read_log(path)
    assert len(log.columns[0].values) == 1500
    assert any("cut short" in remark for remark in log.remarks)


def test_a_model_is_no_log(tmp_path):
    path = tmp_path / "model.yaml"
    path.write_text("robot: generic\njoint: j1\n")
    with pytest.raises(RecordingError, match=r"is YAML, as models and scenarios are.*name a recording"):
        read_log(path)


def test_more_rows_than_are_taken_are_refused_of_arrays_too(tmp_path, monkeypatch):
    monkeypatch.setattr("haptic_teleop_sysid.logs.log.MOST_ROWS", 200)
    path = tmp_path / "log.npz"
    np.savez(path, t=T, u=TORQUE, q=ANGLE)
    assert len(T) > 200
    with pytest.raises(RecordingError, match=r"rows, more than the 200.*--rows"):
        read_log(path)
    assert len(read_log(path, ReadOptions(rows=(1, 200))).columns[0].values) == 200


@pytest.mark.parametrize("row", ["1,2", "1,2,3,4"])
def test_ragged_rows_are_refused_by_line_or_left_out_on_demand(tmp_path, row):
    path = plain_table(tmp_path / "log.csv")
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:100], row, *lines[100:]]) + "\n")
    with pytest.raises(RecordingError, match=r"line 101 has .*--skip-ragged"):
        read_log(path)
    log = read_log(path, ReadOptions(skip_ragged=True))
    assert np.array_equal(log.columns[0].values, 2.0 * np.arange(1500))
    assert any("1 ragged row was left out" in remark for remark in log.remarks)


def test_decimal_points_and_commas_in_one_file_are_refused(tmp_path):
    path = plain_table(tmp_path / "log.csv", delimiter=";")
    lines = path.read_text().splitlines()
    lines[5::2] = [line.replace(".", ",") for line in lines[5::2]]
    path.write_text("\n".join(lines))
    with pytest.raises(RecordingError, match="decimal points and decimal commas"):
        read_log(path)


def test_a_cell_of_text_is_found_with_its_line(tmp_path):
    path = plain_table(tmp_path / "log.csv")
    lines = path.read_text().splitlines()
    lines[7] = "12,oops,3"
    path.write_text("\n".join(["# a comment", *lines[:3], "", "# another", *lines[3:]]))
    found = read_log(path, ReadOptions(rows=(3, 100))).columns[1]
    assert found.text == (11, "oops") and "in line 11: mend it" in found.holds_text
    assert path.read_text().splitlines()[10] == lines[7]


def test_what_is_in_quotes_is_one_cell(tmp_path):
    rows = [f'{t:.3f},"{1e6 * u:,.1f}","a, b",{q:.6f}' for t, u, q in zip(*DATA, strict=True)]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(['t,"u, as it is",note,q', *rows]) + "\n")
    log = read_log(path)
    assert [c.name for c in log.columns] == ["t", "u, as it is", "note", "q"]
    assert np.allclose(log.columns[3].values, ANGLE, atol=1e-6)
    assert "take out what parts its thousands" in log.columns[1].holds_text


def test_20_gigabytes_are_refused_at_once_and_a_part_of_them_is_streamed(tmp_path):
    rows = 0.002 * np.arange(20_000)
    path = table(tmp_path / "huge.csv", ("t", "u", "q"), (rows, np.sin(rows), np.cos(rows)))
    os.truncate(path, 20_000_000_000)  # sparse: it takes no room
    with pytest.raises(RecordingError, match=r"20 GB.*--rows"):
        read_log(path)
    assert len(read_log(path, ReadOptions(rows=(1, 1000))).columns[0].values) == 1000


def test_parquet_is_read_with_units_from_its_fields(tmp_path):
    frame = pd.DataFrame({"t": pd.to_datetime(T, unit="s"), "u": TORQUE, "q": ANGLE, "note": "x"})
    frame.to_parquet(tmp_path / "log.parquet")
    log = read_log(tmp_path / "log.parquet")
    assert_holds(log, DATA)
    assert log.columns[0].stated == "s"
    assert np.array_equal(
        read_log(tmp_path / "log.parquet", ReadOptions(rows=(11, 20))).columns[1].values, TORQUE[10:20]
    )


def test_numpy_files_are_read_and_never_unpickled(tmp_path):
    class Trap:
        def __reduce__(self):
            return os.mkdir, (str(tmp_path / "trapped"),)

    np.savez(
        tmp_path / "log.npz",
        t=T,
        x=np.column_stack([TORQUE, ANGLE]),
        trap=np.array([Trap()] * 300, dtype=object),
    )
    log = read_log(tmp_path / "log.npz")
    assert [c.name for c in log.columns] == ["t", "x[1]", "x[2]"]
    assert_holds(log, DATA)
    assert any("pickled" in remark for remark in log.remarks)
    assert not (tmp_path / "trapped").exists()
    np.save(tmp_path / "log.npy", np.column_stack(DATA))
    assert_holds(read_log(tmp_path / "log.npy"), DATA)


@pytest.mark.parametrize("version", ["4", "5"])
def test_matlab_files_give_arrays(tmp_path, version):
    scipy.io.savemat(tmp_path / "log.mat", {"t": T, "x": np.column_stack([TORQUE, ANGLE])}, format=version)
    assert_holds(read_log(tmp_path / "log.mat"), DATA)


def test_matlab_structs_and_cells_are_named_by_their_way(tmp_path):
    cell = np.empty(2, dtype=object)
    cell[:] = [TORQUE, ANGLE]
    out = {"time": T[:, None], "signals": {"values": np.column_stack([TORQUE, ANGLE]), "label": "x"}}
    scipy.io.savemat(tmp_path / "log.mat", {"out": out, "c": cell, "gain": 3.0, "name": "today"})
    log = read_log(tmp_path / "log.mat")
    assert [c.name for c in log.columns] == [
        "out.time", "out.signals.values[1]", "out.signals.values[2]", "c[1]", "c[2]",
    ]  # fmt: skip
    assert_holds(log, (*DATA, TORQUE, ANGLE))


def matlab_73(path, objects=()):
    """A MAT file of version 7.3, which is HDF5 behind a header of 512 bytes."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in (("t", T[None]), ("x", np.stack([TORQUE, ANGLE]))):
            file.create_dataset(name, data=values).attrs["MATLAB_class"] = np.bytes_("double")
        inner = file.create_group("s")
        inner.attrs["MATLAB_class"] = np.bytes_("struct")
        inner.create_dataset("u", data=SPEED[None]).attrs["MATLAB_class"] = np.bytes_("double")
        for name, kind in objects:
            opaque = file.create_dataset(name, data=np.array([[0xDD000000, 2, 1, 1, 1, 1]], dtype="u4"))
            opaque.attrs["MATLAB_class"], opaque.attrs["MATLAB_object_decode"] = np.bytes_(kind), np.int32(3)
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    return path


def test_matlab_7_3_is_read_with_its_structs(tmp_path):
    log = read_log(matlab_73(tmp_path / "log.mat"))
    found = {c.name: c.values for c in log.columns}
    assert all(
        np.array_equal(found[n], v) for n, v in (("t", T), ("x[1]", TORQUE), ("x[2]", ANGLE), ("s.u", SPEED))
    )


@pytest.mark.parametrize(
    ("kind", "line"), [("timeseries", "log.Time"), ("iddata", "log.InputData"), ("mine", "struct(log)")]
)
def test_matlab_objects_are_passed_over_with_the_line_to_type(tmp_path, kind, line):
    log = read_log(matlab_73(tmp_path / "log.mat", [("log", kind)]))
    assert any(kind in remark and line in remark for remark in log.remarks)


def test_a_matlab_file_of_nothing_but_an_object_is_refused_with_the_line_to_type(tmp_path):
    def part(kind, data):
        return struct.pack("<II", kind, len(data)) + data + b"\0" * (-len(data) % 8)

    numbers = part(6, struct.pack("<II", 13, 0)) + part(5, struct.pack("<ii", 6, 1)) + part(1, b"")
    numbers += part(6, struct.pack("<6I", 0xDD000000, 2, 1, 1, 1, 1))
    flags = part(6, struct.pack("<II", 17, 0))
    body = flags + part(1, b"ts") + part(1, b"MCOS") + part(1, b"timeseries") + part(14, numbers)
    (tmp_path / "log.mat").write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + part(14, body))
    with pytest.raises(RecordingError, match=r"class timeseries.*time = ts\.Time.*save"):
        read_log(tmp_path / "log.mat")


def test_a_matlab_file_that_would_fill_the_memory_is_refused_unread(tmp_path):
    packed = zlib.compress(struct.pack("<II", 14, 0xF0000000) + b"\0" * 100)
    body = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + struct.pack("<II", 15, len(packed)) + packed
    (tmp_path / "log.mat").write_bytes(body)
    with pytest.raises(RecordingError, match=r"4\.03 GB of memory"):
        read_log(tmp_path / "log.mat")


def test_matlab_tables_are_opened(tmp_path):
    frame = pd.DataFrame({"time": T, "torque": TORQUE, "angle": ANGLE})
    matio.save_to_mat(str(tmp_path / "log.mat"), {"run": frame}, version="v7")
    log = read_log(tmp_path / "log.mat")
    assert [c.name for c in log.columns] == ["run.time", "run.torque", "run.angle"]
    assert_holds(log, DATA)


def read_so_far():
    """Bytes that this process has read by calls."""
    counts = dict(line.split(": ") for line in Path("/proc/self/io").read_text().splitlines())
    return int(counts["rchar"])


def test_a_mat_file_of_20_gigabytes_is_refused_unread(tmp_path):
    scipy.io.savemat(tmp_path / "log.mat", {"t": T})
    os.truncate(tmp_path / "log.mat", 20_000_000_000)  # sparse; walking over it would take a minute
    with pytest.raises(RecordingError, match=r"20 GB.*save fewer variables"):
        read_log(tmp_path / "log.mat")
    os.truncate(tmp_path / "log.mat", 1_000_000_000)
    before = read_so_far()
    assert announced_bytes(tmp_path / "log.mat") < 10_000
    assert read_so_far() - before < 1_000_000


@pytest.mark.parametrize(("name", "kind"), [("log.bag", "ros1"), ("log", "MCAP"), ("log", "SQLITE3")])
def test_bags_of_either_ros_are_read_by_topic_and_field(tmp_path, name, kind):
    log = read_log(bag(tmp_path / name, kind))
    found = {c.name: c for c in log.columns}
    for column, values in (
        ("/joint_states:position[elbow]", ANGLE),
        ("/joint_states:velocity[elbow]", SPEED),
        ("/ft:wrench.torque.z", TORQUE),
        ("/arm/state:feedback.positions[elbow]", ANGLE),
    ):
        assert np.array_equal(found[column].values, values[:60]), column
    assert found["/ft:wrench.torque.z"].stated == "N*m"
    stamps = log.stamps["/joint_states"]
    assert np.array_equal(stamps, 50 * 10**9 + 2_000_000 * np.arange(60))
    only = read_log(tmp_path / name, ReadOptions(topics=("/ft",)))
    assert {c.group for c in only.columns} == {"/ft"}


def test_a_definition_that_a_bag_lacks_comes_from_a_file(tmp_path):
    kind = "lab_msgs/msg/Reading"
    text = "float64 torque\nfloat64[2] angles\n"
    store = get_typestore(Stores.ROS2_KILTED)
    store.register(get_types_from_msg(text, kind))
    with Writer2(tmp_path / "log", version=8, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connection = writer.add_connection("/reading", kind, typestore=store)
        for i in range(30):
            message = store.types[kind](torque=TORQUE[i], angles=np.array([ANGLE[i], 0.0]))
            writer.write(connection, 10**9 + i, store.serialize_cdr(message, kind))
    with sqlite3.connect(tmp_path / "log" / "log.db3") as database:  # as recorders before 2023 left it
        database.execute("DELETE FROM message_definitions")
    with pytest.raises(RecordingError, match=r"lab_msgs/msg/Reading.*--msg"):
        read_log(tmp_path / "log")
    file = tmp_path / "lab_msgs" / "msg" / "Reading.msg"
    file.parent.mkdir(parents=True)
    file.write_text(text)
    log = read_log(tmp_path / "log", ReadOptions(definitions=(file,)))
    found = {c.name: c.values for c in log.columns}
    assert np.array_equal(found["/reading:torque"], TORQUE[:30])
    assert np.array_equal(found["/reading:angles[0]"], ANGLE[:30])
    assert any("no stamp" in remark for remark in log.remarks)
    with pytest.raises(ConfigurationError, match=r"package/msg/Type\.msg"):
        read_log(tmp_path / "log", ReadOptions(definitions=(tmp_path / "Reading.txt",)))


def test_a_file_that_crashes_its_reader_is_lost_alone(tmp_path):
    with pytest.raises(RecordingError, match="fails altogether"):
        read_isolated(signal.raise_signal, signal.SIGSEGV)
    scipy.io.savemat(tmp_path / "log.mat", {"t": T})  # the next one is read
    assert_holds(read_log(tmp_path / "log.mat"), (T,))


def damaged(tmp_path):
    """(file, what its sentence says) of every kind of file that cannot be read."""
    rng = np.random.default_rng(1)
    np.savez(tmp_path / "good.npz", t=T)
    pd.DataFrame({"t": T}).to_parquet(tmp_path / "good.parquet")
    scipy.io.savemat(tmp_path / "good.mat", {"t": T})
    bag(tmp_path / "good.bag", "ros1")
    with zipfile.ZipFile(tmp_path / "sheet.zip", "w") as packed:
        packed.writestr("a.xml", "x")
    locked = bytearray((tmp_path / "good.npz").read_bytes())
    locked[locked.rindex(b"PK\x01\x02") + 8] |= 1  # the flag of an entry that is encrypted
    contents = {
        "locked.npz": (bytes(locked), "is encrypted"),
        "empty.csv": (b"", "is empty"),
        "words.csv": (b"hello\nworld\n", "no row of it holds numbers"),
        "random.csv": (rng.bytes(4096), "encrypted or packed"),
        "cut.npz": ((tmp_path / "good.npz").read_bytes()[:200], "begins as an npz file and is damaged"),
        "cut.parquet": ((tmp_path / "good.parquet").read_bytes()[:200], "damaged or encrypted Parquet"),
        "cut.mat": ((tmp_path / "good.mat").read_bytes()[:300], "damaged or no MAT file"),
        "cut.bag": ((tmp_path / "good.bag").read_bytes()[:600], "damaged bag"),
        "sheet.xlsx": ((tmp_path / "sheet.zip").read_bytes(), "spreadsheet"),
        "log.csv.gz": (b"\x1f\x8b\x08\x00", "gunzip"),
        "log.csv.enc": (b"Salted__" + rng.bytes(100), "is encrypted"),
    }
    for name, (content, said) in contents.items():
        (tmp_path / name).write_bytes(content)
        yield tmp_path / name, said


def test_what_cannot_be_read_is_refused_in_one_sentence(tmp_path):
    for path, said in damaged(tmp_path):
        with pytest.raises(RecordingError, match=said):
            read_log(path)
    with pytest.raises(RecordingError, match="no such file"):
        read_log(tmp_path / "nothing.csv")


def test_a_table_cut_anywhere_is_read_or_refused_but_never_fails(tmp_path):
    content = plain_table(tmp_path / "log.csv", delimiter=";", decimal=",").read_bytes()[:600]
    path = tmp_path / "cut.csv"
    for size in range(1, len(content), 7):
        path.write_bytes(content[:size])
        try:
            log = read_log(path)
        except RecordingError:
            continue
        rows = len(log.columns[0].values)
        assert rows <= content[:size].count(b"\n")
        if [c.name for c in log.columns] == list(HEADER):
            assert np.array_equal(log.columns[0].values, 2.0 * np.arange(rows))
