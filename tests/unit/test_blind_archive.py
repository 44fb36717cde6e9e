"""A run of the blind benchmark: diagnoses in forks, and the file with which it goes on elsewhere."""

import io
import json
import sys
import tarfile
from pathlib import Path

import numpy as np
import pytest
from blind_rigs import FAKE

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.recording import read_recording
from haptic_teleop_sysid.blind import command
from haptic_teleop_sysid.blind.archive import pack, unpack
from haptic_teleop_sysid.blind.runner import FRONT_DOOR, RAN, diagnose
from haptic_teleop_sysid.blind.sealing import open_labels, seal
from haptic_teleop_sysid.spread import spread


@pytest.mark.long
def test_a_run_goes_on_elsewhere_from_its_archive_and_is_scored_there(tmp_path: Path) -> None:
    fake = tmp_path / "fake.py"
    fake.write_text(FAKE)
    kept, first, other = tmp_path / "kept.tar.xz", tmp_path / "first", tmp_path / "other"
    arguments = ["--seed", "2", "--cases", "single=1,clean=1", "--levels", "32", "--jobs", "1"]
    tool = ["--command", f"{sys.executable} {fake}", "--archive", str(kept)]
    assert command.main([*arguments, *tool, "--output", str(first)]) == 0
    # As if one case had not run yet.
    gone = first / "cases" / "case0002"
    (gone / "run.json").unlink()
    (first / "cases" / "case0001" / "diagnosis" / "diagnosis.json").write_text(
        json.dumps({"verdict": "no_mismatch", "note": f"{first}/cases/case0001"})
    )
    assert pack(first, kept) == 1
    before = kept.read_bytes()
    assert pack(first, kept) == 1 and kept.read_bytes() == before and str(tmp_path).encode() not in before
    assert command.main([*arguments, *tool, "--output", str(other)]) == 0
    assert not (other / "cases" / "case0001" / "model.yaml").exists()  # had run: nothing to draw
    for part in ("estimation", "validation"):
        drawn = [read_recording(d / "cases" / "case0002" / part) for d in (first, other)]
        read = [one.topics["/sfj/joint_states"].signal("stage1_motor", "position") for one in drawn]
        assert np.array_equal(*read)
    assert json.loads((other / "blind.json").read_text())["cases_run"] == 2
    again = tmp_path / "again"
    scored_anew = [*arguments, "--only", "score", "--archive", str(kept), "--output", str(again)]
    assert command.main(scored_anew) == 0
    assert (again / "table.md").read_text() == (other / "table.md").read_text()
    assert command.main(["--seed", "3", *scored_anew[2:]]) == 2  # another seed's archive
    # What was drawn again must be what the seal says.
    place = other / "cases" / "case0002"
    labels = open_labels(place, "2", [])
    labels["case0002"]["stage"] = "stage3"
    seal(labels, place, "2")
    assert command.main([*arguments, "--only", "score", "--output", str(other)]) == 2


def test_an_archive_that_is_none_is_refused(tmp_path: Path) -> None:
    rubbish = tmp_path / "rubbish.tar.xz"
    rubbish.write_bytes(b"no archive")
    with pytest.raises(ConfigurationError, match="cannot be read"):
        unpack(rubbish, tmp_path / "out")
    with tarfile.open(rubbish, "w:xz") as archive:
        member = tarfile.TarInfo("cases/../../outside.json")
        member.size = 2
        archive.addfile(member, io.BytesIO(b"{}"))
    with pytest.raises(ConfigurationError, match="which no run writes"):
        unpack(rubbish, tmp_path / "out")
    assert not (tmp_path / "outside.json").exists()
    with tarfile.open(rubbish, "w:xz") as archive:
        pass
    with pytest.raises(ConfigurationError, match="lacks"):
        unpack(rubbish, tmp_path / "out")


def test_a_forked_diagnosis_tells_its_status_and_last_words_and_is_killed_in_time(tmp_path: Path) -> None:
    for name in ("estimation", "validation"):
        (tmp_path / name).mkdir()
    (tmp_path / "model.yaml").write_text("schema: 1\nrubbish: true\n")
    ran = diagnose(tmp_path, (*FRONT_DOOR, "--no-report"), 120.0)
    assert ran["status"] == "2" and "model.yaml" in ran["message"]
    assert json.loads((tmp_path / RAN).read_text()) == ran
    assert diagnose(tmp_path, (*FRONT_DOOR, "--no-report"), 1e-6)["status"] == "timeout"


def test_a_diagnosis_runs_on_a_worker_of_dask_which_may_not_fork(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    for name in ("estimation", "validation"):
        (tmp_path / name).mkdir()
    (tmp_path / "model.yaml").write_text("schema: 1\nrubbish: true\n")
    (ran,) = spread(diagnose, [(tmp_path, (*FRONT_DOOR, "--no-report"), 120.0)], 1, "local", "", threads=True)
    assert ran["status"] == "2" and "model.yaml" in ran["message"]


def test_a_dask_scheduler_that_does_not_answer_is_told_with_the_remedy() -> None:
    dask = pytest.importorskip("dask")
    pytest.importorskip("distributed")
    with (
        dask.config.set({"distributed.comm.timeouts.connect": "1s"}),
        pytest.raises(ConfigurationError, match=r"127\.0\.0\.1:1.*--dask local"),
    ):
        spread(diagnose, [()], 1, "127.0.0.1:1", "")
