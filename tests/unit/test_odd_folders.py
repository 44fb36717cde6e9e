"""What lies beside recordings, what is told of logs that are taken as they are, and who leaves early."""

import os
import signal
import zipfile

import numpy as np
import pytest
from joint_logs import machine, plain_table, table

from haptic_teleop_control.command_line import run_command
from haptic_teleop_control.errors import RecordingError
from haptic_teleop_sim.model import load_model
from haptic_teleop_sysid.commands import compare, dataset_report, estimate, export, import_log, model_from_log
from haptic_teleop_sysid.logs.opened import open_recording
from haptic_teleop_sysid.logs.prose import is_prose
from haptic_teleop_sysid.logs.reading import read_log
from haptic_teleop_sysid.many.characterise import damage_of
from haptic_teleop_sysid.many.each import claim
from haptic_teleop_sysid.many.folder import find_recordings
from haptic_teleop_sysid.report import claimed
from haptic_teleop_sysid.runs.estimation_run import Choices, load_one

T, TORQUE, ANGLE, SPEED = machine()
TABLE = "\n".join(f"{0.002 * i:.3f} {0.1 * i:.3f} {i % 7}" for i in range(40))
PROSE = [
    "Robot 3, logged at 500 Hz on Monday.\nThe belt was changed before run 12.\n",
    "Kp 3.0\nKi 2.0\nKd 0.1\n",
    "week friction stiffness\n1 0.30 4.0\n2 0.31 4.0\n3 0.30 3.9\n\nby hand\nsee the report\nof the lab\n",
    "# a comment\n# and another one\n",
    "numpy==2.1.0\nscipy==1.14\n",
    "# Ünïcode\n\nAchtung: Motor 2 läuft warm, 60 °C nach 10 min.\n",
]
RECORDINGS = [
    TABLE,
    "t u q\n" + TABLE,
    "logger 7\nserial 33\n" * 30 + TABLE[: len(TABLE) // 3],  # cut short, behind a long head
    "time [ms];torque [Nmm];angle [deg]\n",  # nothing came behind the header
    TABLE.replace("0.100", "OVERLOAD").replace("0.700", "0.7 0.8"),
    TABLE.replace(".", ","),
    "",
    "\x00\x01\x02\x7f" * 40,
]


@pytest.mark.parametrize("text", PROSE)
def test_a_text_that_people_wrote_is_no_recording(tmp_path, text):
    for name in ("README.txt", "notes.dat"):
        (tmp_path / name).write_text(text, encoding="utf-8")
        assert is_prose(tmp_path / name)
    (tmp_path / "log.csv").write_text(text, encoding="utf-8")  # it claims to be a table
    assert not is_prose(tmp_path / "log.csv")


@pytest.mark.parametrize("text", RECORDINGS)
def test_a_table_is_a_recording_however_broken(tmp_path, text):
    (tmp_path / "run.txt").write_text(text, encoding="utf-8")
    assert not is_prose(tmp_path / "run.txt")


def test_what_is_no_recording_is_named_and_passed_over_and_what_is_broken_is_kept(tmp_path, capsys):
    (tmp_path / "logs").mkdir()
    plain_table(tmp_path / "logs" / "good.csv")
    whole = (tmp_path / "logs" / "good.csv").read_text()
    (tmp_path / "logs" / "half.txt").write_text(whole[: len(whole) // 2] + "\x00" * 40)
    (tmp_path / "logs" / "README.txt").write_text(PROSE[0])
    listing = find_recordings([tmp_path / "logs"])
    assert [f.name for f in listing.found] == ["good.csv", "half.txt"]
    assert listing.passed == ("README.txt",) and "README.txt" in listing.told[0]
    assert import_log.main([str(tmp_path / "logs"), "--output", str(tmp_path / "out")]) == 1
    told = capsys.readouterr()
    assert "passed over, being no recording:" in told.err and "1 of 2 logs imported" in told.out


def test_a_zip_file_is_called_what_it_is(tmp_path):
    for name, content, words in (
        ("logs.zip", ("run1.csv", "run2.csv"), "zip file with run1.csv, run2.csv in it.*unzip"),
        ("book.bin", ("xl/workbook.xml",), "is a spreadsheet"),
        ("none.zip", (), "zip file with nothing in it"),
    ):
        with zipfile.ZipFile(tmp_path / name, "w") as packed:
            for member in content:
                packed.writestr(member, "x")
        with pytest.raises(RecordingError, match=words):
            read_log(tmp_path / name)
    (tmp_path / "junk.zip").write_bytes(b"PK\x03\x04 and nothing more")
    with pytest.raises(RecordingError, match="begins as a zip file and is damaged"):
        read_log(tmp_path / "junk.zip")


@pytest.mark.parametrize(("row", "seconds"), [(1300, 1.2), (1000, 0.9), (700, 0.3)])
def test_a_clock_that_is_set_back_is_told_with_row_and_times_and_blamed_on_nothing_else(
    tmp_path, row, seconds
):
    time = T.copy()
    time[row:] -= seconds
    header = ("time [s]", "torque [Nm]", "q [rad]", "dq [rad/s]")
    log = table(tmp_path / "log.csv", header, (time, TORQUE, ANGLE, SPEED))
    (told,) = open_recording(log).problems
    assert f"first at row {row + 1}, from {T[row - 1]:.6g} s to {time[row]:.6g} s" in told


def test_a_contradiction_in_a_log_whose_time_goes_back_names_that_too(tmp_path):
    time = T.copy()
    time[1000:] -= 0.9
    header = ("time [s]", "torque [Nm]", "q [rad]", "dq [rad/s]")
    log = table(tmp_path / "log.csv", header, (time, TORQUE, np.degrees(ANGLE), SPEED))
    with pytest.raises(ValueError, match=r"degrees taken for radians.*But time goes back 1 time.*row 1001"):
        open_recording(log)


@pytest.fixture(scope="module")
def rigid(tmp_path_factory):
    """(log, its model file): made by `model` from the log itself."""
    folder = tmp_path_factory.mktemp("rigid")
    log = plain_table(folder / "log.csv")
    lines = log.read_text().splitlines()
    log.write_text("\n".join([*lines, "2998.0,1"]))  # cut short
    assert model_from_log.main(["--from", str(log), "--output", str(folder / "model.yaml")]) == 0
    return log, folder / "model.yaml"


SAID = ("line 1502, the last, is cut short and was left out", "each number times 0.01745329252 is rad")


@pytest.mark.parametrize(
    ("command", "more"), [("model", []), ("dataset", ["-v"]), ("compare", []), ("export", ["--verbose"])]
)
def test_how_a_log_was_read_is_told_once_by_whoever_takes_it(rigid, tmp_path, capsys, command, more):
    log, model = rigid
    out = str(tmp_path / "out")
    run = {
        "model": lambda: model_from_log.main(["--from", str(log), "--output", f"{out}.yaml", *more]),
        "dataset": lambda: dataset_report.main(["--bag", str(log), "--output", out, *more]),
        "compare": lambda: compare.main(["--model", str(model), "--bag", str(log), "--output", out, *more]),
        "export": lambda: export.main(
            ["--model", str(model), "--to", "python", "--bag", str(log), "--output", f"{out}.py", *more]
        ),
    }
    assert run[command]() == 0
    told = capsys.readouterr().err
    assert [told.count(words) for words in SAID] == [1, len(more)]


def test_how_a_log_was_read_stands_in_the_outcome_of_an_estimate_and_is_not_told_of_its_recording(
    rigid, tmp_path
):
    log, path = rigid
    model = load_model(path)
    assert all(any(words in line for line in load_one(str(log), model, Choices())[2]) for words in SAID)
    cut = open_recording(log)
    assert not cut.complete and damage_of(cut, str(log)) == [SAID[0]]
    assert import_log.main([str(log), "--output", str(tmp_path / "bag")]) == 0
    assert not any("each number" in line for line in load_one(str(tmp_path / "bag"), model, Choices())[2])


@pytest.fixture
def hears_ctrl_c():
    """A background job of a shell, and all that it starts, begin deaf to it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("hears_ctrl_c")
def test_ctrl_c_is_told_in_a_line_and_leaves_no_empty_folder(rigid, tmp_path, monkeypatch, capsys):
    log, model = rigid
    out = tmp_path / "deep" / "out"

    def interrupted(*_, **__):
        os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(estimate, "run_estimate", interrupted)
    arguments = ["--model", str(model), "--bag", str(log), "--output", str(out)]
    assert estimate.main(arguments) == 130
    assert capsys.readouterr().err.strip().endswith("interrupted; nothing was written")
    assert not (tmp_path / "deep").exists()


def test_who_leaves_early_keeps_what_is_written_and_says_so(tmp_path, capsys):
    def main(argv):
        with claimed(tmp_path / "out", "result.json"):
            (tmp_path / "out" / "model.yaml").write_text("x")
            raise KeyboardInterrupt

    assert run_command(main, []) == 130
    assert "out holds what was written so far, which is no whole result" in capsys.readouterr().err
    assert (tmp_path / "out" / "model.yaml").exists()

    def many(argv):
        with claim(tmp_path / "many") as output:
            (output / "a").mkdir()
            (output / "a" / "outcome.json").write_text("{}")
            (output / "b").mkdir()
            raise KeyboardInterrupt

    assert run_command(many, []) == 130
    assert "the same command goes on from there" in capsys.readouterr().err
    assert (tmp_path / "many" / "a" / "outcome.json").exists() and not (tmp_path / "many" / "b").exists()

    def mistaken(argv):
        with claimed(tmp_path / "no" / "where", "result.json"):
            raise RecordingError("broken: mend it.")

    assert run_command(mistaken, []) == 2 and not (tmp_path / "no").exists()


def test_a_result_is_never_written_over_what_is_read(tmp_path, capsys):
    t, torque, angle, _ = machine()
    log = table(tmp_path / "log.csv", ("time [s]", "torque [Nm]", "q [rad]"), (t, torque, angle))
    before = log.read_bytes()
    assert model_from_log.main(["--from", str(log), "--output", str(log), "--overwrite"]) == 2
    assert "is what this run reads, and would be lost" in capsys.readouterr().err
    assert log.read_bytes() == before
    model = tmp_path / "model.yaml"
    assert model_from_log.main(["--from", str(log), "--output", str(model)]) == 0
    before = model.read_bytes()
    assert export.main(["--model", str(model), "--to", "python", "--output", str(model), "--overwrite"]) == 2
    assert model.read_bytes() == before
    driven = ["--bag", str(log), "--output", str(log), "--overwrite"]
    before = log.read_bytes()
    assert export.main(["--model", str(model), "--to", "python", *driven]) == 2
    assert log.read_bytes() == before
    bag = tmp_path / "bag"
    assert import_log.main([str(log), "--output", str(bag)]) == 0
    inside = ["--output", str(bag / "metadata.yaml"), "--overwrite"]
    assert model_from_log.main(["--from", str(bag), *inside]) == 2
    capsys.readouterr()
    kept = sorted(p.name for p in bag.iterdir())
    assert estimate.main(["--model", str(model), "--bag", str(bag), "--output", str(bag)]) == 2
    assert "bag is a recording: choose another --output" in capsys.readouterr().err
    assert sorted(p.name for p in bag.iterdir()) == kept


def test_a_recording_without_an_input_gives_no_model_and_says_what_it_lacks(tmp_path, capsys):
    t, _, angle, _ = machine()
    log = table(tmp_path / "log.csv", ("time [s]", "q [rad]"), (t, angle))
    mapping = tmp_path / "mapping.yaml"
    mapping.write_text(
        'haptic_teleop_import: 1\ntime: {column: "time [s]"}\n'
        'joints: {joint: {motor: {position: {column: "q [rad]"}}}}\n'
    )
    bag = tmp_path / "bag"
    assert import_log.main([str(log), "--mapping", str(mapping), "--output", str(bag)]) == 0
    assert model_from_log.main(["--from", str(bag), "--output", str(tmp_path / "model.yaml")]) == 2
    assert "has no input beside its positions" in capsys.readouterr().err
