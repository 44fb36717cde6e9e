"""`estimate` and `dataset` on the command line: what they write, and one sentence for what cannot be used."""

import html
import json
import re
import shlex
from dataclasses import replace

import numpy as np
import pytest
import yaml
from identification_plants import STAGE, axis_recording, stage_recording

from haptic_teleop_control.recording import JointStateSeries, write_recording
from haptic_teleop_sim.model import load_model
from haptic_teleop_sysid.commands import estimate
from haptic_teleop_sysid.commands.compare import main as compare_main
from haptic_teleop_sysid.commands.dataset_report import main as dataset_main
from haptic_teleop_sysid.commands.diagnose import _parser as diagnose_arguments
from haptic_teleop_sysid.commands.estimate import main
from haptic_teleop_sysid.recordings.preparation import Treatment, prepare, resampled
from haptic_teleop_sysid.runs.next_command import again_command

SECONDS = 8.0


@pytest.fixture(scope="module")
def recording():
    return stage_recording(seconds=SECONDS)


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "model.yaml"
    STAGE.save(path)
    return path


def written(tmp_path, recording, name="bag", **changes):
    """A bag of the recording, its states changed field by field."""
    states = recording.topics["/sfj/joint_states"]
    topics = {**recording.topics, "/sfj/joint_states": replace(states, **changes)}
    return write_recording(tmp_path / name, topics, {}, recording.experiment)


def refused(capsys, *arguments, command=main):
    """The sentence of a run that must end with status 2."""
    assert command([str(a) for a in arguments]) == 2
    told = capsys.readouterr().err
    assert "Traceback" not in told
    return " ".join(told.split())


def kept(series, keep):
    arrays = ("stamp", "received", "position", "velocity", "effort")
    found = {n: getattr(series, n)[keep] for n in arrays if getattr(series, n) is not None}
    return replace(series, **found)


def test_a_run_writes_model_numbers_and_report(tmp_path, model, recording, capsys):
    bag, other = written(tmp_path, recording), tmp_path / "other"
    write_recording(other, stage_recording(seed=2, seconds=6.0).topics, {}, {"kind": "open loop"})
    arguments = ["--model", str(model), "--bag", str(bag), "--validation", str(other), "--output"]
    assert main([*arguments, str(tmp_path / "out")]) == 0
    result = json.loads((tmp_path / "out" / "estimate.json").read_text())
    rows = {row["name"]: row for row in result["parameters"]}
    assert rows["stiffness"]["status"] == "fixed"
    assert rows["arm_inertia"]["value"] == pytest.approx(0.17, rel=1e-3)
    assert rows["arm_inertia"]["interval"][0] < rows["arm_inertia"]["interval"][1]
    assert result["converged"] is True
    assert set(result["fit"]["estimate"]) == {str(bag), str(other)}
    assert result["recordings"][str(other)]["role"] == "validation"
    estimated = load_model(tmp_path / "out" / "model.yaml")
    assert estimated.parameters["arm_inertia"] == rows["arm_inertia"]["value"]
    assert "<svg" in (tmp_path / "out" / "report.html").read_text()
    assert "std. error" in capsys.readouterr().out
    assert "earlier run" in refused(capsys, *arguments, tmp_path / "out")


@pytest.mark.usefixtures("unillustrated")
def test_the_offset_of_a_current_sense_makes_no_right_model_look_wrong_in_compare(
    tmp_path, model, recording, capsys
):
    bag = written(tmp_path, recording)
    assert compare_main(["--model", str(model), "--bag", str(bag), "--output", str(tmp_path / "o")]) == 0
    result = json.loads((tmp_path / "o" / "compare.json").read_text())
    assert result["recordings"][str(bag)]["input"] == "commanded effort"
    assert min(result["fits"][str(model)][str(bag)].values()) > 90.0


@pytest.mark.usefixtures("unillustrated")
def test_where_two_predictors_disagree_one_thing_is_to_be_done(tmp_path, shared_data, repository, capsys):
    pendulum = repository / "tests" / "data" / "dfki_gravity_coulomb.yaml"
    bag = shared_data / "real" / "dfki" / "estimation"
    arguments = ["--model", str(pendulum), "--bag", str(bag), "--output"]
    assert main([*arguments, str(tmp_path / "one")]) == 0
    told = capsys.readouterr().out
    assert told.count("these parameters do not hold for slow motion") == 1
    assert told.count("what to do:") == 1 and told.count("haptic-teleop ") == 1
    (command,) = [line for line in told.splitlines() if "haptic-teleop " in line]
    program, name, *words = shlex.split(command)
    assert (program, name) == ("haptic-teleop", "diagnose")
    parsed = vars(diagnose_arguments().parse_args(words))
    assert parsed["model"] == [str(pendulum)] and parsed["estimation"] == [str(bag)]
    for other in ("--method", "--multi-start", "do not use"):
        assert other not in told
    page = html.unescape((tmp_path / "one" / "report.html").read_text())
    headings = re.findall(r"<h2 id=[^>]*>(.*?)</h2>", page)
    assert headings[:2] == ["Parameters", "Why these parameters do not hold"]
    assert command.strip() in page and "differ by more than chance" in page


def test_an_empty_recording(tmp_path, model, recording, capsys):
    empty = kept(recording.topics["/sfj/joint_states"], slice(0, 0))
    bag = write_recording(tmp_path / "empty", {"/sfj/joint_states": empty}, {}, {})
    assert "empty" in refused(capsys, "--model", model, "--bag", bag, "--output", tmp_path / "o")
    (tmp_path / "nothing").mkdir()
    told = refused(capsys, "--model", model, "--bag", tmp_path / "nothing", "--output", tmp_path / "o")
    assert "nothing" in told


@pytest.mark.usefixtures("unillustrated")
def test_a_truncated_recording_is_used_as_far_as_it_goes_and_says_so(tmp_path, model, recording, capsys):
    bag = written(tmp_path, recording)
    file = next(bag.glob("*.mcap"))
    file.write_bytes(file.read_bytes()[: int(0.7 * file.stat().st_size)])
    assert main(["--model", str(model), "--bag", str(bag), "--output", str(tmp_path / "o")]) == 0
    result = json.loads((tmp_path / "o" / "estimate.json").read_text())
    assert result["recordings"][str(bag)]["problems"]
    assert result["recordings"][str(bag)]["samples"] < SECONDS * 500
    capsys.readouterr()
    assert compare_main(["--model", str(model), "--bag", str(bag), "--output", str(tmp_path / "c")]) == 0
    assert "messages are there" in " ".join(capsys.readouterr().err.split())


def test_a_recording_with_a_single_joint(tmp_path, model, recording, capsys):
    states = recording.topics["/sfj/joint_states"]
    one = JointStateSeries(
        states.stamp,
        states.received,
        ("stage1_motor",),
        *(getattr(states, f)[:, :1] for f in ("position", "velocity", "effort")),
    )
    bag = write_recording(tmp_path / "one", {"/sfj/joint_states": one}, {}, {})
    assert "no joint stage1_arm" in refused(
        capsys, "--model", model, "--bag", bag, "--output", tmp_path / "o"
    )


def test_an_input_that_never_changes(tmp_path, model, recording, capsys):
    topics = dict(recording.topics)
    command = topics["/sfj/effort_command"]
    topics["/sfj/effort_command"] = replace(command, effort=np.full_like(command.effort, 0.5))
    bag = write_recording(tmp_path / "constant", topics, {}, {})
    told = refused(capsys, "--model", model, "--bag", bag, "--output", tmp_path / "o")
    assert "not identifiable" in told and "never changes" in told
    arguments = ["--model", model, "--bag", bag, "--output", tmp_path / "o", "--fit-parameters"]
    assert "never changes" in refused(capsys, *arguments, command=compare_main)


def test_a_joint_that_stands_still(tmp_path, model, recording, capsys):
    still = np.zeros_like(recording.topics["/sfj/joint_states"].position)
    bag = written(tmp_path, recording, position=still)
    told = refused(capsys, "--model", model, "--bag", bag, "--output", tmp_path / "o")
    assert "not identifiable" in told and "encoder steps" in told


@pytest.mark.usefixtures("unillustrated")
def test_values_that_are_no_numbers_are_left_out_and_told(tmp_path, model, recording):
    position = recording.topics["/sfj/joint_states"].position.copy()
    position[1000:1003] = np.nan
    bag = written(tmp_path, recording, position=position)
    assert main(["--model", str(model), "--bag", str(bag), "--output", str(tmp_path / "o")]) == 0
    result = json.loads((tmp_path / "o" / "estimate.json").read_text())
    assert any("no finite number" in p for p in result["recordings"][str(bag)]["problems"])
    rows = {row["name"]: row for row in result["parameters"]}
    assert rows["arm_inertia"]["value"] == pytest.approx(0.17, rel=1e-2)


@pytest.mark.usefixtures("unillustrated")
def test_commands_that_are_no_numbers_leave_the_measured_input_to_estimate_from(tmp_path, model, recording):
    topics = dict(recording.topics)
    command = topics["/sfj/effort_command"]
    topics["/sfj/effort_command"] = replace(command, effort=np.full_like(command.effort, np.nan))
    bag = write_recording(tmp_path / "bag", topics, {}, recording.experiment)
    assert main(["--model", str(model), "--bag", str(bag), "--output", str(tmp_path / "o")]) == 0
    result = json.loads((tmp_path / "o" / "estimate.json").read_text())
    assert result["recordings"][str(bag)]["input"] == "measured effort"
    rows = {row["name"]: row for row in result["parameters"]}
    assert rows["arm_inertia"]["value"] == pytest.approx(0.17, rel=1e-2)


def test_a_recording_of_five_samples(tmp_path, model, recording, capsys):
    five = kept(recording.topics["/sfj/joint_states"], slice(0, 5))
    bag = write_recording(tmp_path / "five", {"/sfj/joint_states": five}, {}, {})
    assert "5 usable samples" in refused(capsys, "--model", model, "--bag", bag, "--output", tmp_path / "o")


def test_a_recording_of_ten_hours_is_refused_unread(tmp_path, model, recording, capsys):
    bag = written(tmp_path, recording)
    path = bag / "metadata.yaml"
    content = yaml.safe_load(path.read_text())
    information = content["rosbag2_bagfile_information"]
    information["message_count"] = 36_000_000
    information["duration"]["nanoseconds"] = 36_000_000_000_000
    path.write_text(yaml.safe_dump(content))
    for command in (main, dataset_main, compare_main):
        told = refused(capsys, "--model", model, "--bag", bag, "--output", tmp_path / "o", command=command)
        assert "10.0 h" in told and "cut a shorter one" in told


def test_a_start_outside_its_bounds_and_names_that_do_not_exist(tmp_path, model, recording, capsys):
    common = ["--model", model, "--bag", written(tmp_path, recording), "--output", tmp_path / "o"]
    told = refused(capsys, *common, "--bound", "arm_inertia=1:2")
    assert "arm_inertia starts at 0.17, outside its bounds 1 to 2" in told
    assert "has no parameter 'mass'" in refused(capsys, *common, "--fix", "mass")
    assert "does not read NAME=LOW:HIGH" in refused(capsys, *common, "--bound", "arm_inertia")
    every = [n for n in STAGE.parameters if n != "stiffness"]
    assert "nothing to estimate" in refused(capsys, *common, "--fix", *every)


def test_two_bags_of_different_robots(tmp_path, model, recording, capsys):
    good = written(tmp_path, recording)
    omni = write_recording(tmp_path / "omni", axis_recording(seconds=2.0).topics, {}, {})
    told = refused(capsys, "--model", model, "--bag", good, omni, "--output", tmp_path / "o")
    assert "stage1 of sfj" in told and str(omni) in told


def test_the_data_set_report_judges_recording_and_excitation(tmp_path, model, recording, capsys):
    states = recording.topics["/sfj/joint_states"]
    holed = kept(states, np.r_[0:1000, 1050 : len(states)])
    bag = write_recording(tmp_path / "holed", {**recording.topics, "/sfj/joint_states": holed}, {}, {})
    arguments = ["--bag", str(bag), "--output", str(tmp_path / "look")]
    assert dataset_main([*arguments, "--model", str(model)]) == 0
    found = json.loads((tmp_path / "look" / "dataset.json").read_text())["recordings"][0]
    assert found["topics"]["/sfj/joint_states"]["lost"] == 50
    assert any("1 gap of" in problem for problem in found["problems"])
    assert set(found["expected_std"]) == set(STAGE.free_parameters())
    low, high = found["band_hz"]
    assert 0.1 <= low < high <= 13.0
    assert "samples are lost" in " ".join(capsys.readouterr().out.split())


@pytest.mark.usefixtures("unillustrated")
def test_the_data_set_report_ends_with_a_command_that_estimate_takes(tmp_path, model, recording):
    bag = written(tmp_path, recording)
    arguments = ["--bag", str(bag), "--model", str(model), "--range", "0.5", "8", "--detrend", "linear"]
    assert dataset_main([*arguments, "--output", str(tmp_path / "look")]) == 0
    page = html.unescape((tmp_path / "look" / "report.html").read_text())
    words = shlex.split(re.search(r"<code>(haptic-teleop estimate .*?)</code>", page)[1])
    taken = estimate._parser().parse_args(words[2:])
    assert (taken.model, taken.bag, taken.range) == (str(model), [str(bag)], [0.5, 8.0])
    assert taken.detrend == "linear" and taken.lead_in == "auto"


@pytest.mark.usefixtures("unillustrated")
def test_a_recording_is_rich_enough_where_every_parameter_will_be_known(tmp_path, model, recording):
    said = []
    for name, bag in (("long", recording), ("short", stage_recording(seconds=0.4, band=(0.2, 2.0)))):
        arguments = ["--bag", str(written(tmp_path, bag, name)), "--model", str(model)]
        assert dataset_main([*arguments, "--output", str(tmp_path / f"look {name}")]) == 0
        found = json.loads((tmp_path / f"look {name}" / "dataset.json").read_text())["recordings"][0]
        worst = max(found["expected_relative_std"].values())
        assert (worst > 0.2) == (name == "short")
        said.append(" ".join(found["judgement"]))
    assert "rich enough" in said[0] and "not well known" not in said[0]
    assert "rich enough" not in said[1] and "not well known from this recording" in said[1]


@pytest.mark.usefixtures("unillustrated")
def test_the_data_set_report_tells_what_a_poor_signal_cannot_teach(tmp_path, recording):
    # All six free: the scale common to all cannot show in any recording.
    free = tmp_path / "free.yaml"
    replace(STAGE, fixed=()).save(free)
    bag = written(tmp_path, recording)
    arguments = ["--bag", str(bag), "--model", str(free), "--output", str(tmp_path / "look")]
    assert dataset_main(arguments) == 0
    found = json.loads((tmp_path / "look" / "dataset.json").read_text())["recordings"][0]
    assert "torque_constant" in found["undetermined"]


def test_treatments_do_what_they_say(recording):
    from haptic_teleop_sysid.recordings.dataset import load_dataset

    dataset = load_dataset(recording, STAGE, "bag")
    halved = resampled(dataset, 250.0)
    assert halved.dt == pytest.approx(2 * dataset.dt)
    assert np.array_equal(halved.motor_position, dataset.motor_position[::2][: len(halved)])
    assert halved.input == pytest.approx(dataset.input.reshape(-1, 2).mean(axis=1))
    moved = replace(dataset, motor_position=dataset.motor_position + 0.3)
    back, told = prepare(moved, recording, STAGE, Treatment(lead_in=0.5, offset="remove"))
    expected = np.mean(moved.motor_position[5:250])
    assert back.motor_position[0] == pytest.approx(moved.motor_position[250] - expected)
    assert any("moved by" in sentence for sentence in told)
    flat, _ = prepare(dataset, recording, STAGE, Treatment(lead_in="none", detrend="linear", span=(1.0, 5.0)))
    slope = np.polyfit(flat.time, flat.motor_position, 1)[0]
    assert abs(slope) < 1e-12


@pytest.mark.usefixtures("unillustrated")
def test_what_to_expect_of_a_recording_does_not_hang_on_how_wrong_the_model_is(tmp_path, model, recording):
    """What a model with wrong values leaves unexplained is no noise: an estimate does not have to live with
    it."""
    off = {"motor_inertia": 0.5, "motor_damping": 2.0, "arm_inertia": 1.8, "arm_damping": 3.0}
    parameters = {n: v * off.get(n, 1.0) for n, v in STAGE.parameters.items()}
    replace(STAGE, parameters=parameters).save(tmp_path / "off.yaml")
    bag, told = str(written(tmp_path, recording)), {}
    for name in (model.stem, "off"):
        arguments = [
            "--bag",
            bag,
            "--model",
            str(tmp_path / f"{name}.yaml"),
            "--output",
            str(tmp_path / f"look {name}"),
        ]
        assert dataset_main(arguments) == 0
        found = json.loads((tmp_path / f"look {name}" / "dataset.json").read_text())["recordings"][0]
        told[name] = found["expected_std"]
    assert told["off"] == pytest.approx(told[model.stem], rel=0.5)


def test_what_is_to_be_run_again_states_no_option_twice():
    given = ["--bag", "a", "--method=output-error", "--multi-start", "2", "--output", "o"]
    said = again_command("estimate", given, "again", "--multi-start", "6", "--method", "prediction-error")
    assert said == (
        "haptic-teleop estimate --bag a --multi-start 6 --method prediction-error --output again"
    )
