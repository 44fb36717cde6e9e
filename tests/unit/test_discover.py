"""`discover` from the draw to the report: what is sealed, what the diagnosis gets to see, and what is said of
right, wrong and failed answers. The diagnosis itself is replaced by answers made here, all else is real.
"""

import hashlib
import json
import re
import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest

from haptic_teleop_control.recording import JointStateSeries, read_recording, write_recording
from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sim.model import Effect, Model, load_model
from haptic_teleop_sim.mujoco_effects import unexpressed
from haptic_teleop_sysid.discovery import campaign, chain
from haptic_teleop_sysid.discovery import command as discover
from haptic_teleop_sysid.discovery.drawing import LEFT_OUT, choices, draw, lab_model
from haptic_teleop_sysid.discovery.outcome import judge

SECONDS = 6.0


@pytest.fixture(scope="module")
def experiment():
    return campaign.planned(SECONDS)


def drawn(experiment, seed, only_mujoco=False):
    return draw(seed, *experiment, 0.002, only_mujoco)


def seed_of(experiment, effect, place):
    """The first seed that draws this effect at this place."""
    for seed in range(2000):
        found = drawn(experiment, seed).hidden
        if found.effect == effect and found.location.endswith(f"_{place}"):
            return seed
    raise AssertionError(f"{effect} at {place} is never drawn")


def test_a_seed_gives_its_robot_again_and_another_seed_another(experiment):
    assert drawn(experiment, 5) == drawn(experiment, 5)
    assert len({drawn(experiment, seed).hidden.effect for seed in range(40)}) > 12


def test_every_place_of_the_table_is_drawn_or_said_to_be_left_out():
    drawable = {(kind.effect, part) for kind, part in choices()}
    drawn = [e for e in EFFECTS.values() if not (e.nuisance or e.unnamed or e.tabulated)]
    table = {(e.name, place) for e in drawn for place in e.where}
    rigid_only = {(name, "motor") for name in ("gravity", "payload_change", "angle_dependent_inertia")}
    assert drawable.isdisjoint(LEFT_OUT)
    assert drawable | set(LEFT_OUT) == table - rigid_only


def test_the_lab_knows_the_stiffness_and_the_rest_only_roughly(experiment):
    for seed in range(30):
        robot = drawn(experiment, seed)
        assert not robot.lab[robot.stage].effects
        for stage in ("stage1", "stage2"):
            true, believed = robot.models[stage].parameters, robot.lab[stage].parameters
            ratios = {name: true[name] / believed[name] for name in true}
            assert ratios.pop("stiffness") == 1.0
            assert max(abs(r - 1.0) for r in ratios.values()) <= 0.15
            assert ratios["motor_inertia"] != 1.0
        assert [stage for stage in robot.models if robot.models[stage].effects] == [robot.stage]


def test_only_what_mujoco_can_say_is_drawn_for_mujoco(experiment):
    effects = set()
    for seed in range(40):
        robot = drawn(experiment, seed, only_mujoco=True)
        assert not unexpressed(robot.models[robot.stage])
        effects.add(robot.hidden.effect)
    assert len(effects) > 8


def answer(directory: Path, model: Model, baseline: Model, findings, verdict="identified") -> dict:
    """What a diagnosis leaves in a case's directory."""
    output = directory / "diagnosis"
    output.mkdir()
    model.save(output / "augmented_model.yaml")
    content = {
        "verdict": verdict,
        "findings": [
            {
                "effect": effect,
                "location": location,
                "confidence": 0.9,
                "alternatives": [{"effect": e, "location": p, "confidence": 0.1} for e, p in others],
                "parameters": {n: {"value": v, "std": 0.01, "unit": ""} for n, v in values.items()},
            }
            for effect, location, values, others in findings
        ],
        "where": [],
        "baseline_parameters": baseline.parameter_values(),
    }
    (output / "diagnosis.json").write_text(json.dumps(content))
    ran = {"status": "0", "seconds": 1.0, "message": ""}
    (directory / "run.json").write_text(json.dumps(ran))
    return ran


@pytest.mark.parametrize(
    ("verdict", "findings", "outcome"),
    [
        ("identified", [("backlash", "stage1_joint", {"width": 0.02}, [])], "right"),
        (
            "ambiguous",
            [("backlash", "stage1_joint", {"width": 0.02}, [("hysteresis", "stage1_joint")])],
            "right",
        ),
        ("ambiguous", [("hysteresis", "stage1_joint", {}, [("backlash", "stage1_joint")])], "in the set"),
        (
            "identified",
            [("gravity", "stage1_arm", {}, []), ("backlash", "stage1_joint", {"width": 0.02}, [])],
            "in the set",
        ),
        ("identified", [("hysteresis", "stage1_joint", {}, [("backlash", "stage1_joint")])], "right place"),
        ("identified", [("gravity", "stage1_arm", {}, [])], "wrong"),
        ("unknown", [], "unknown"),
        ("no_mismatch", [], "missed"),
    ],
)  # fmt: skip
def test_an_answer_is_judged_by_name_place_and_stated_set(tmp_path, verdict, findings, outcome):
    lab = lab_model("stage1")
    truth = {
        "effect": "backlash", "location": "stage1_joint", "parameters": {"width": 0.025}, "scored": ["width"],
        "detectability": None,
    }  # fmt: skip
    label = {
        "kind": "single", "stage": "stage1", "loop": "open loop current", "truth": [truth],
        "sets": [[["backlash", "stage1_joint"]]], "truth_parameters": dict(lab.parameters),
    }  # fmt: skip
    answer(tmp_path, lab, lab, findings, verdict)
    judgement = judge(label, tmp_path)
    assert judgement.outcome == outcome
    assert judgement.right == (outcome == "right")
    if outcome == "right":
        assert judgement.parameters[0]["error"] == pytest.approx(0.2)


def test_the_right_name_at_the_wrong_place_is_not_called_a_wrong_name(tmp_path):
    lab = lab_model("stage1")
    truth = {
        "effect": "encoder_scale", "location": "stage1_arm_encoder", "parameters": {"scale": 1.03},
        "scored": ["scale"], "detectability": None,
    }  # fmt: skip
    label = {
        "kind": "single", "stage": "stage1", "loop": "open loop current", "truth": [truth],
        "sets": [[["encoder_scale", "stage1_arm_encoder"]]], "truth_parameters": dict(lab.parameters),
    }  # fmt: skip
    said = [("encoder_scale", "stage1_motor_encoder", {"scale": 1.03}, [])]
    answer(tmp_path, lab, lab, said, "identified")
    judgement = judge(label, tmp_path)
    assert judgement.outcome == "wrong"
    assert "the place is wrong" in judgement.sentence and "nor" not in judgement.sentence


class Stand:
    """A stand-in for the diagnosis that looks around before it answers."""

    def __init__(self, monkeypatch, tmp_path, respond):
        self.respond, self.seen, self.files, self.left = respond, [], {}, []
        self.temporary = tmp_path / "temporary"
        self.temporary.mkdir()
        monkeypatch.setattr(tempfile, "tempdir", str(self.temporary))
        monkeypatch.setattr(chain, "diagnose", self)

    def __call__(self, case, command, timeout, tell):
        self.seen = sorted(str(p.relative_to(case)) for p in case.rglob("*"))
        self.left = list(self.temporary.iterdir())
        self.command = command
        self.files = {p: p.read_bytes() for p in case.parent.rglob("*") if p.is_file()}
        return self.respond(case)


def start(tmp_path, seed, *options):
    output = tmp_path / "out"
    arguments = ["--seed", str(seed), "--output", str(output), "--lockstep", "--seconds", str(SECONDS)]
    return discover.main([*arguments, *options]), output


@pytest.mark.long
def test_the_true_model_as_an_answer_is_right_and_simulates_what_was_recorded(
    tmp_path, monkeypatch, experiment, capsys
):
    seed = seed_of(experiment, "spring_to_ground", "arm")
    robot = drawn(experiment, seed)
    hidden, lab = robot.hidden, robot.lab[robot.stage]
    told = []

    def respond(case):
        told.append(capsys.readouterr().err)
        finding = (hidden.effect, hidden.location, dict(hidden.parameters), [])
        return answer(case, robot.models[robot.stage], lab, [finding])

    stand = Stand(monkeypatch, tmp_path, respond)
    status, output = start(tmp_path, seed, "--plant", "sfj_sim")
    assert status == 0
    content = json.loads((output / "discover.json").read_text())
    # Sealed before, opened after, and the same.
    (digest,) = re.findall(r"SHA-256 ([0-9a-f]{64})", told[0])
    assert hashlib.sha256((output / "label.json").read_bytes()).hexdigest() == digest == content["digest"]
    assert hidden.effect not in told[0]
    assert content["label"]["truth"][0]["parameters"] == pytest.approx(dict(hidden.parameters))
    assert len(content["label"]["nonce"]) == 32
    # The diagnosis sees bags and the lab's model; no file tells the secret.
    assert "--allow-gaps" not in stand.command
    top = {name.split("/")[0] for name in stand.seen}
    assert top == {"model.yaml", "estimation", "validation"}
    assert not stand.left
    recordings = {p for p in stand.files if p.suffix == ".mcap"}
    assert len(recordings) == 3
    for path, data in stand.files.items():
        if path not in recordings:
            assert hidden.effect.encode() not in data, path
        else:
            assert hidden.effect not in json.dumps(read_recording(path.parent).parameters)
    assert load_model(output / "case" / "model.yaml").parameters == lab.parameters
    # What comes of it.
    assert content["outcome"] == "right"
    for part in ("scenario1", "validation"):
        fits = content["fits"][part]
        before, after = (np.mean(list(fits[name].values())) for name in ("lab", "augmented"))
        assert after > 95.0
        assert before < after - 10.0
    opened = load_model(output / "opened" / f"{robot.stage}.yaml")
    assert [e.effect for e in opened.effects] == [hidden.effect]
    assert f"hidden:   {hidden.effect} @ {hidden.location}" in capsys.readouterr().out
    page = (output / "report.html").read_text()
    assert digest in page
    assert "<svg" in page
    assert (output / "scenario1.png").stat().st_size > 10_000


def without_samples(recording, missing):
    """The same recording without some of the states."""
    whole = read_recording(recording)
    states = whole.topic("/sfj/joint_states")
    kept = np.delete(np.arange(len(states)), missing)
    cut = JointStateSeries(
        states.stamp[kept], states.received[kept], states.names,
        *(getattr(states, field)[kept] for field in ("position", "velocity", "effort")),
    )  # fmt: skip
    shutil.rmtree(recording)
    topics = {**whole.topics, "/sfj/joint_states": cut}
    write_recording(recording, topics, whole.parameters, whole.experiment)


@pytest.mark.usefixtures("unillustrated")
def test_holes_in_a_recording_are_left_out_and_told(tmp_path, monkeypatch, experiment):
    run, seed = campaign.run_acquisition, seed_of(experiment, "spring_to_ground", "arm")
    robot = drawn(experiment, seed)

    def lossy(file, recording, lockstep):
        status = run(file, recording, lockstep)
        if recording.name == "validation":
            without_samples(recording, np.arange(1500, 1520))
        return status

    def respond(case):
        return answer(case, robot.models[robot.stage], robot.lab[robot.stage], [], "no_mismatch")

    monkeypatch.setattr(campaign, "run_acquisition", lossy)
    stand = Stand(monkeypatch, tmp_path, respond)
    status, output = start(tmp_path, seed, "--plant", "sfj_sim")
    assert status == 0
    assert "--allow-gaps" in stand.command
    content = json.loads((output / "discover.json").read_text())
    assert content["notes"] == ["holes in the recording for validation, left out: 1"]
    assert content["outcome"] == "missed"
    assert np.mean(list(content["fits"]["validation"]["augmented"].values())) > 90.0


def test_a_run_of_the_graph_that_failed_is_told_and_not_tried_a_second_time(tmp_path, monkeypatch, capsys):
    acquire, tried = campaign.run_acquisition, []
    monkeypatch.setattr(campaign, "run_acquisition", lambda file, bag, lockstep: acquire(file, bag, True))

    def stopped(file, plant, recording, lockstep):
        assert not lockstep
        tried.append(recording.exists())
        recording.mkdir()
        return 1

    monkeypatch.setattr(campaign, "run_scenario1", stopped)
    arguments = ["--seed", "3", "--plant", "sfj_sim", "--seconds", str(SECONDS)]
    assert discover.main([*arguments, "--output", str(tmp_path / "out")]) == 1
    assert tried == [False]
    told = capsys.readouterr().err
    assert "scenario 1 ended with exit status 1" in told


@pytest.mark.usefixtures("unillustrated")
def test_a_wrong_name_is_told_as_wrong_and_the_chain_ends_with_0(tmp_path, monkeypatch, experiment, capsys):
    seed = seed_of(experiment, "joint_damping", "joint")
    stage = drawn(experiment, seed).stage

    def respond(case):
        lab = load_model(case / "model.yaml")
        stop = Effect("hard_stop", f"{stage}_arm", {"angle": 0.9, "stiffness": 50.0})
        wrong = lab.with_effects(stop)
        return answer(case, wrong, lab, [("hard_stop", f"{stage}_arm", {"angle": 0.9}, [])])

    Stand(monkeypatch, tmp_path, respond)
    status, output = start(tmp_path, seed, "--plant", "sfj_sim")
    assert status == 0
    content = json.loads((output / "discover.json").read_text())
    assert content["outcome"] == "wrong"
    assert content["right"] is False
    assert "the place is wrong" in capsys.readouterr().out
    # Its stop takes the place of the wall, which cannot stand there a second time.
    assert any("without the wall" in note for note in content["notes"])


@pytest.mark.long
@pytest.mark.usefixtures("unillustrated")
def test_mujoco_is_the_robot_where_it_can_express_what_is_hidden(tmp_path, monkeypatch, experiment):
    pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install mujoco")
    seed = seed_of(experiment, "backlash", "joint")
    robot = drawn(experiment, seed)
    hidden = robot.hidden

    def respond(case):
        finding = (hidden.effect, hidden.location, dict(hidden.parameters), [])
        return answer(case, robot.models[robot.stage], robot.lab[robot.stage], [finding])

    Stand(monkeypatch, tmp_path, respond)
    status, output = start(tmp_path, seed)
    assert status == 0
    content = json.loads((output / "discover.json").read_text())
    assert content["plant"] == "mujoco_sim"
    for bag in ("case/estimation", "case/validation", "scenario1"):
        recording = read_recording(output / bag)
        assert "/sfj/mujoco_sim" in recording.parameters
        assert recording.complete
    # Another engine's backlash, and still the same motion, if the model is the true one.
    assert np.mean(list(content["fits"]["validation"]["augmented"].values())) > 95.0


def test_what_mujoco_has_no_words_for_comes_from_the_sealed_file(tmp_path, monkeypatch, experiment):
    seed = seed_of(experiment, "torque_ripple", "motor")
    Stand(monkeypatch, tmp_path, lambda case: {"status": "1", "seconds": 0.1, "message": "broken on purpose"})
    status, output = start(tmp_path, seed)
    assert status == 1
    assert "/sfj/sfj_sim" in read_recording(output / "scenario1").parameters


def test_without_mujoco_the_robot_comes_from_the_sealed_file(tmp_path, monkeypatch, experiment):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    seed = seed_of(experiment, "backlash", "joint")
    Stand(monkeypatch, tmp_path, lambda case: {"status": "1", "seconds": 0.1, "message": "broken on purpose"})
    status, output = start(tmp_path, seed)
    assert status == 1
    assert "/sfj/sfj_sim" in read_recording(output / "scenario1").parameters


def test_a_failed_diagnosis_ends_with_1_and_the_label_stays_sealed(tmp_path, monkeypatch, capsys):
    Stand(monkeypatch, tmp_path, lambda case: {"status": "1", "seconds": 0.1, "message": "broken on purpose"})
    status, output = start(tmp_path, 3, "--plant", "sfj_sim")
    assert status == 1
    assert "broken on purpose" in capsys.readouterr().err
    assert not (output / "label.json").exists()
    assert not (output / "discover.json").exists()


def test_ctrl_c_tells_what_the_folder_holds(tmp_path, monkeypatch, capsys):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(discover, "discover", interrupted)
    assert discover.main(["--seed", "1", "--plant", "sfj_sim", "--output", str(tmp_path / "o")]) == 130
    told = capsys.readouterr().err
    assert f"interrupted; {tmp_path / 'o'} holds what was made so far" in told and "Traceback" not in told


def test_an_aborted_acquisition_is_a_failed_step(tmp_path, monkeypatch, capsys):
    content = campaign.acquisition_content

    def cautious(stage, which, seconds):
        changed = content(stage, which, seconds)
        changed["acquisition"]["ros__parameters"]["limit"]["position"] = 1e-3
        return changed

    monkeypatch.setattr(campaign, "acquisition_content", cautious)
    assert start(tmp_path, 3, "--plant", "sfj_sim")[0] == 1
    assert "acquisition for estimation ended with exit status 1" in capsys.readouterr().err


@pytest.mark.parametrize("options", [["--seed", "-1"], ["--seed", "x"], ["--seed", "1", "--seconds", "1"],
                                     ["--seed", "1", "--plant", "real"], []])  # fmt: skip
def test_bad_arguments_end_with_2(tmp_path, options):
    assert discover.main([*options, "--output", str(tmp_path / "out")]) == 2
    assert not (tmp_path / "out").exists()


def test_a_used_directory_and_a_missing_mujoco_are_refused_in_one_sentence(tmp_path, monkeypatch, capsys):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.txt").write_text("mine")
    assert start(tmp_path, 1)[0] == 2
    assert "not empty" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "mujoco", None)
    assert discover.main(["--seed", "1", "--plant", "mujoco", "--output", str(tmp_path / "new")]) == 2
    assert "pip install mujoco" in capsys.readouterr().err
