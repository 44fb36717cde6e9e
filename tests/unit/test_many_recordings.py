"""Folders of recordings and several joints in one call: found, spread, kept, ranked."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from identification_plants import STAGE
from weekly_recordings import NEW, write_week

from haptic_teleop_control.errors import ConfigurationError, RecordingError
from haptic_teleop_sysid.commands import diagnose, estimate
from haptic_teleop_sysid.logs.opened import open_recording
from haptic_teleop_sysid.many import diagnoses
from haptic_teleop_sysid.many.diagnoses import overview, split
from haptic_teleop_sysid.many.each import Job, Means, each
from haptic_teleop_sysid.many.estimates import together
from haptic_teleop_sysid.many.folder import find_recordings
from haptic_teleop_sysid.many.kept import DONE, FAILED, UNUSABLE
from haptic_teleop_sysid.many.ranking import overview_sentence, ranked
from haptic_teleop_sysid.recordings.dataset import load_dataset

MODEL = str(Path(__file__).resolve().parents[2] / "config/models/sfj_stage1.yaml")
COMMAND = "from haptic_teleop_control.front_door import main; raise SystemExit(main())"


def test_bags_and_logs_are_found_at_any_depth_whatever_state_they_are_in(tmp_path):
    for name in ("a/metadata.yaml", "deep/er/b/b_0.mcap", "log.csv", "notes.md", ".hidden/c.csv", "d.mcap"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("")
    names = [f.name for f in find_recordings([tmp_path]).found]
    assert names == ["a", "d.mcap", "deep/er/b", "log.csv"]
    (tmp_path / "deep" / "trend.json").write_text("")
    assert [f.name for f in find_recordings([tmp_path]).found] == ["a", "d.mcap", "log.csv"]
    (tmp_path / "deep" / "trend.json").unlink()
    assert [f.name for f in find_recordings([tmp_path / "a", tmp_path / "deep"]).found] == ["a", "er/b"]
    typed = find_recordings([tmp_path / "log.csv", tmp_path / "a"])
    assert typed.typed and [f.name for f in typed.found] == ["log.csv", "a"]
    with pytest.raises(ConfigurationError, match="given twice"):
        find_recordings([tmp_path / "a", tmp_path])
    with pytest.raises(ConfigurationError, match="is not there"):
        find_recordings([tmp_path / "no"])


def _work(number, folder):
    if number == 2:
        raise RecordingError("this one is damaged: record it again.")
    if number == 3:
        return {"found": [][1]}
    return {"found": number}


def test_what_ended_is_kept_and_what_made_the_program_fail_is_tried_again(tmp_path):
    before = os.environ.get("HAPTIC_TELEOP_THREADS")
    source = tmp_path / "bag"
    source.write_text("bag")
    jobs = [Job(f"r{n}", tmp_path / f"r{n}", (source,), _work, (n,), ("settings", n)) for n in range(4)]
    found, known = each("testing", jobs, Means(1))
    assert known == 0 and [found[f"r{n}"]["status"] for n in range(4)] == [DONE, DONE, UNUSABLE, FAILED]
    assert "IndexError" in found["r3"]["message"] and "each.py" not in found["r2"]["message"]
    assert each("testing", jobs, Means(1))[1] == 3
    assert each("testing", jobs, Means(1, afresh=True))[1] == 0
    changed = [replace(job, settings="other") for job in jobs[:1]]
    assert each("testing", changed, Means(1))[1] == 0
    source.write_text("another bag")
    assert each("testing", jobs, Means(1))[1] == 0
    assert os.environ.get("HAPTIC_TELEOP_THREADS") == before, "what holds for the work is put back"


@pytest.mark.long
def test_a_run_on_two_workers_of_dask_that_was_killed_goes_on(tmp_path, capsys):
    distributed = pytest.importorskip("distributed")
    bags, out, model = tmp_path / "bags", tmp_path / "out", tmp_path / "new.yaml"
    for week in range(1, 7):
        write_week(bags, week, seconds=3.0)
    NEW.save(model)
    (bags / "broken.mcap").write_bytes(b"\x89MCAP0\r\n and nothing more")
    arguments = ["--model", str(model), "--bags", str(bags), "--output", str(out), "--no-report"]
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0"
    ) as cluster:
        arguments += ["--dask", cluster.scheduler_address]
        run = subprocess.Popen([sys.executable, "-c", COMMAND, "estimate", *arguments])
        until = time.monotonic() + 120.0
        while len(ended := list(out.rglob("outcome.json"))) < 2 and time.monotonic() < until:
            time.sleep(0.02)
        os.kill(run.pid, signal.SIGKILL)
        assert run.wait() == -signal.SIGKILL
        before = {path: path.stat().st_mtime_ns for path in ended}
        assert 2 <= len(before) < 7
        assert estimate.main(arguments) == 0
    told = capsys.readouterr()
    assert "were known from earlier runs" in told.err and "not used: broken.mcap" in told.out
    assert {path: path.stat().st_mtime_ns for path in before} == before
    content = json.loads((out / "estimates.json").read_text())
    assert [o["status"] for o in content["recordings"].values()].count(DONE) == 6
    inertia = content["together"]["motor_inertia"]
    assert inertia["count"] == 6 and inertia["mean"] == pytest.approx(
        NEW.parameters["motor_inertia"], abs=4 * inertia["std"]
    )
    assert (out / "report.html").exists() and len((out / "estimates.csv").read_text().splitlines()) == 8


def estimated(value, std=1.0):
    return {
        "status": DONE,
        "converged": True,
        "parameters": {"stiffness": {"value": value, "std": std, "unit": "N*m/rad"}},
    }


def test_a_mean_is_no_surer_than_the_scatter_about_it():
    alike = together({"a": estimated(9.0), "b": estimated(11.0)})["stiffness"]
    assert (alike["mean"], alike["scatter"], alike["alike"]) == (10.0, 2.0, True)
    assert alike["std"] == pytest.approx(1.0)  # half the distance
    apart = together({"a": estimated(0.0), "b": estimated(20.0), "c": estimated(None, None)})["stiffness"]
    assert apart["std"] == pytest.approx(10.0) and not apart["alike"] and apart["count"] == 2


def test_a_recording_is_split_into_what_teaches_and_what_judges(tmp_path):
    data = load_dataset(open_recording(str(write_week(tmp_path, 1, seconds=6.0))), STAGE)
    (first,), (last,) = split(data)
    assert last.start > float(first.time[-1]) and len(first) + len(last) == len(data)
    assert len(last) == pytest.approx(len(data) / 3, abs=2)
    with pytest.raises(RecordingError, match="too short"):
        split(data.between(0.0, 1.4))


def content(verdict="no_mismatch", given=95.0, left=99.0, findings=(), moved=()):
    fits = {"estimation": {}, "validation": {"arm.position": given}, "test": {}}
    best = {"estimation": {}, "validation": {"arm.position": left}, "test": {}}
    return {
        "verdict": verdict,
        "fit": {"given": fits, "augmented": best},
        "findings": list(findings),
        "parameters_moved": list(moved),
        "where": [],
        "recordings": {},
    }


FOUND = {"effect": "backlash", "location": "stage2_joint"}
SAID = {
    "stage1": content(given=60.0, left=60.0),
    "stage2": content("identified", 90.0, findings=[FOUND]),
    "omni_x": content("unknown", 70.0),
    "omni_y": content("identified", None, findings=[FOUND]),
}


def test_joints_are_diagnosed_in_one_call_and_ranked_by_what_is_wrong(tmp_path, monkeypatch, capsys):
    """The diagnosis itself is tested elsewhere; here it says what is asked of it, and one joint cannot."""
    monkeypatch.setattr(
        diagnoses, "load", lambda bag, model, mapping: SimpleNamespace(name=bag, experiment={})
    )
    monkeypatch.setattr(diagnoses, "refuse_too_long", lambda bags, model: None)
    monkeypatch.setattr(diagnoses, "refuse_too_many", lambda data: None)
    asked = {}

    def diagnosed(model, recordings, folder, options):
        asked[model.joint] = [[one.name] for part in recordings for one in part]
        if model.joint == "omni_z":
            raise RecordingError("no omni_z in it.")
        return SAID[model.joint], None

    monkeypatch.setattr(diagnoses, "diagnose_into", diagnosed)
    models = [str(tmp_path / f"{joint}.yaml") for joint in (*SAID, "omni_z")]
    for path, joint in zip(models, (*SAID, "omni_z"), strict=True):
        replace(STAGE, robot="generic", joint=joint, io=_io()).save(path)
    (tmp_path / "e").mkdir()
    (tmp_path / "v").mkdir()
    out = tmp_path / "out"
    given = ["--estimation", str(tmp_path / "e"), "--validation", str(tmp_path / "v"), "--jobs", "1"]
    assert diagnose.main(["--model", *models, *given, "--output", str(out)]) == 0
    assert asked["stage1"] == [[str(tmp_path / "e")], [str(tmp_path / "v")]]
    said = json.loads((out / "overview.json").read_text())
    assert [row["name"] for row in said["ranking"]] == ["omni_y", "omni_x", "stage2", "stage1"]
    assert "Something is missing or off in 3 of 4; first omni_y: backlash" in capsys.readouterr().out
    assert said["unusable"] == [{"name": "omni_z", "why": "no omni_z in it."}]
    page = (out / "report.html").read_text()
    assert 'href="stage2/report.html"' in page and "no omni_z in it." in page
    assert (out / "stage1" / "outcome.json").exists()
    twice = ["--model", models[0], models[0], *given, "--output", str(out)]
    assert diagnose.main(twice) == 2 and "two models are of the joint stage1" in capsys.readouterr().err


def _io():
    return {
        "input": {"topic": "/p", "joint": "j", "field": "effort"},
        "motor": {"topic": "/p", "joint": "j"},
        "arm": {"topic": "/p", "joint": "k"},
    }


def outcome(verdict, given, moved=()):
    return {"status": DONE, **overview(content(verdict, given, moved=moved))}


def test_what_differs_by_what_is_not_worth_a_word_is_counted_apart():
    moved = [{"parameter": "stiffness", "given": 1.0, "value": 2.0, "std": 0.1, "unit": "1"}]
    large, slight = outcome("unknown", 80.0), outcome("identified", 99.91)
    both = {"a": slight, "b": large}
    assert ranked(both) == ["b", "a"]
    said = overview_sentence(both)
    assert said.startswith("Something is missing or off in 1 of 2; first b: ")
    assert said.endswith("; the other, a, differs by 0.09 %.")
    said = overview_sentence({"a": slight, "c": outcome("ambiguous", 98.0)})
    assert said == "Nothing that matters is wrong with any of the 2; 2 of them differ by 2 % at most."
    # A parameter that is off matters however well its model simulates, and so does one signal among many.
    assert outcome("no_mismatch", 99.91, moved)["matters"] and not outcome("no_mismatch", 50.0)["matters"]
    one = content("identified")
    one["fit"]["given"]["validation"] = {"p": 99.9, "q": 99.9, "r": 99.9, "v": 94.0}
    assert overview(one)["error"] < 0.05 and overview(one)["matters"]


def test_an_error_is_that_of_the_recordings_that_were_used_least():
    said = content(given=80.0, left=97.0)
    said["fit"]["given"]["test"], said["fit"]["augmented"]["test"] = {"p": 70.0, "v": 90.0}, {"p": 99.0}
    told = overview(said)
    assert told["judged_by"] == "test" and told["error"] == pytest.approx((0.05) ** 0.5)
    moved = overview(
        content(moved=[{"parameter": "stiffness", "given": 1.0, "value": 2.0, "std": 0.1, "unit": "1"}])
    )
    assert moved["wrong"] and moved["what"].startswith("off: stiffness 1 -> 2")
    outcomes = {"a": {"status": DONE, **overview(content())}, "b": {"status": UNUSABLE, "message": "x"}}
    assert (
        ranked(outcomes) == ["a"]
        and overview_sentence(outcomes) == "Nothing was found missing or off in any of the 1."
    )


@pytest.mark.parametrize(
    "arguments, words",
    [
        (["--model", "m.yaml", "--output", "o"], "either --estimation"),
        (["--model", "m.yaml", "--estimation", "e", "--output", "o"], "needs --validation"),
        (
            ["--model", MODEL, "--estimation", "e", "--validation", "v", "--output", "o", "--jobs", "2"],
            "--jobs goes",
        ),
        (["--model", "m.yaml", "--estimation", "e", "--bags", "b", "--output", "o"], "either --estimation"),
    ],
)
def test_options_that_do_not_go_together_are_refused(arguments, words, capsys):
    assert diagnose.main(arguments) == 2 and words in capsys.readouterr().err
