"""`compare` from the command line: its numbers, its files, its refusals, and what it says of real
recordings."""

import contextlib
import html
import io
import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from identification_plants import STAGE, stage_recording
from joint_recordings import TRUTH, excitation, joint_recording, response

from haptic_teleop_control.recording import read_recording, write_recording
from haptic_teleop_sim.model import Model, load_model
from haptic_teleop_sysid.commands import compare
from haptic_teleop_sysid.runs.comparison import compare as compare_models
from haptic_teleop_sysid.runs.comparison_pictures import comparison_pictures, percent_text
from haptic_teleop_sysid.runs.comparison_report import comparison_page
from haptic_teleop_sysid.runs.comparison_verdict import conclusion
from haptic_teleop_sysid.runs.told_roles import role_comment, told_role

TRUE_MODEL = Model("sfj", "stage1", "flexible_joint", TRUTH, fixed=("stiffness", "torque_constant"))
MODELS = Path(__file__).resolve().parents[1] / "data"


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    current = excitation(2500)
    made = joint_recording(current, response(current))
    folder = tmp_path_factory.mktemp("bag")
    return str(write_recording(folder / "recordings <i>", made.topics, made.parameters, made.experiment))


@pytest.fixture(scope="module")
def models(tmp_path_factory):
    """A right and a wrong model file."""
    folder = tmp_path_factory.mktemp("models")
    right, wrong = folder / "right.yaml", folder / "wrong.yaml"
    TRUE_MODEL.save(right)
    replace(TRUE_MODEL, parameters={**TRUTH, "motor_inertia": 0.2}).save(wrong)
    return [str(right), str(wrong)]


@pytest.fixture(scope="module")
def compared(tmp_path_factory, bag, models):
    """Where a comparison of both models lies, and what it printed."""
    output, printed = tmp_path_factory.mktemp("compared") / "out", io.StringIO()
    with contextlib.redirect_stdout(printed):
        assert run("--model", *models, "--bag", bag, "--output", output) == 0
    return output, printed.getvalue()


def run(*arguments):
    return compare.main([str(argument) for argument in arguments])


def result(output):
    return json.loads((Path(output) / "compare.json").read_text())


def test_models_are_told_apart_under_the_names_given(compared, bag, models):
    output, table = compared
    fits = result(output)["fits"]
    assert set(fits) == set(models)
    assert set(fits[models[0]]) == {bag}
    assert fits[models[0]][bag]["stage1_arm.position"] > 99.9
    assert fits[models[1]][bag]["stage1_arm.position"] < 95.0
    assert set(fits[models[1]][bag]) == {
        f"stage1_{side}.{what}" for side in ("motor", "arm") for what in ("position", "velocity")
    }
    assert "100.0" in table
    assert "report:" in table
    # Of 80 columns and a long path, and still each column says what it is.
    assert "…" not in table
    assert table.count("position") == table.count("velocity") == 2


def test_the_report_shows_a_picture_and_escapes_names(compared, models):
    output, _ = compared
    page = (output / "report.html").read_text()
    assert page.count("<svg role=") == 1 + len(models)  # the responses, and the residuals of each model
    assert "recordings &lt;i&gt;" in page
    assert "<i>" not in page
    # One file that needs nothing else.
    assert not re.search(r'(src|href)="(?!#)', page)
    assert (output / "compare.png").read_bytes().startswith(b"\x89PNG")


def test_the_worst_signal_is_told_with_a_word_and_the_command_that_finds_out_why(bag, models):
    found = compare_models({models[0]: TRUE_MODEL}, {bag: read_recording(bag)})
    for percent, word, status in ((56.7, "poor", "fair"), (-3.0, "no better than a constant", "bad")):
        fit = found.fits[models[0], bag]
        fit.percent["stage1_arm.velocity"] = percent
        told = conclusion(found, "haptic-teleop diagnose ...")
        assert told[0] == status
        assert f"Worst is stage1_arm.velocity with {percent_text(percent)} %, which is {word}." in told[1]
        assert told[3] == "haptic-teleop diagnose ..."
    page = comparison_page(found, comparison_pictures(found), "haptic-teleop diagnose ...").render()
    page = html.unescape(page)
    assert "<pre tabindex=\"0\"><code>haptic-teleop diagnose ..." in page and "estimate.json" in page


def poor(fit):
    """Make all signals of a fit follow no better than a constant."""
    fit.percent.update(dict.fromkeys(fit.percent, -46.0))


def test_a_joint_that_hardly_moves_is_no_alarm_and_is_said_first(bag, models):
    current = 1e-3 * excitation(2500)
    small = joint_recording(current, response(current))
    found = compare_models({models[0]: TRUE_MODEL}, {"small": small})
    poor(found.fits[models[0], "small"])
    status, happened, todo, command = conclusion(found, "haptic-teleop diagnose ...")
    assert (status, command) == ("fair", "") and happened.startswith("The joint hardly moves (by ")
    assert "larger motion" in todo and "no better than a constant" not in happened
    # Beside a recording that moves it has no say.
    both = compare_models({models[0]: TRUE_MODEL}, {"small": small, bag: read_recording(bag)})
    poor(both.fits[models[0], "small"])
    assert conclusion(both)[0] == "good"


def test_the_pictures_have_the_colours_that_the_files_ask_for(tmp_path):
    roles = {}
    for name, held in (("augmented_model.yaml", "baseline"), ("own.yaml", None), ("model.yaml", None)):
        TRUE_MODEL.save(tmp_path / name, [] if held is None else ["from a diagnosis", role_comment(held)])
        roles[name] = told_role(tmp_path / name)
    assert roles == {"augmented_model.yaml": "re-estimated", "own.yaml": None, "model.yaml": None}
    assert told_role(tmp_path / "no.yaml") is None


def test_a_model_that_follows_everything_needs_no_command(compared, models):
    output, told = compared
    assert "ok: right.yaml comes nearest" in told and "what to do: simulate with \"right.yaml\"." in told
    assert "haptic-teleop diagnose" not in told


@pytest.mark.usefixtures("unillustrated")
def test_fitted_parameters_are_reported_and_saved_as_a_model(tmp_path, bag, models):
    output = tmp_path / "out"
    assert run("--model", models[1], "--bag", bag, "--output", output, "--fit-parameters") == 0
    content = result(output)
    assert content["fits"][models[1]][bag]["stage1_motor.position"] > 99.9
    fitted = load_model(output / content["parameter_fit"][models[1]]["model"])
    assert fitted.parameters["motor_inertia"] == pytest.approx(TRUTH["motor_inertia"], rel=0.01)
    assert load_model(models[1]).parameters["motor_inertia"] == 0.2


@pytest.mark.usefixtures("unillustrated")
def test_window_and_range_are_used_and_stated(tmp_path, bag, models):
    output = tmp_path / "out"
    chosen = ("--window", "0.5", "--range", "1", "3")
    assert run("--model", models[0], "--bag", bag, "--output", output, *chosen) == 0
    content = result(output)
    assert content["windows"][bag]["seconds"] == pytest.approx(0.5, abs=0.01)
    assert len(content["windows"][bag]["samples"]) == 4
    assert content["recordings"][bag]["start_s"] == pytest.approx(1.0)
    assert content["recordings"][bag]["end_s"] == pytest.approx(3.0)


@pytest.mark.usefixtures("unillustrated")
def test_models_of_one_bag_share_the_windows_of_the_first(tmp_path, bag, models):
    output = tmp_path / "out"
    assert run("--model", *reversed(models), "--bag", bag, "--output", output, "--window", "1") == 0
    assert len(result(output)["windows"]) == 1


@pytest.mark.usefixtures("unillustrated")
def test_an_earlier_result_is_kept_unless_overwriting_is_asked_for(tmp_path, compared, bag, models, capsys):
    output = shutil.copytree(compared[0], tmp_path / "out")
    arguments = ("--model", models[0], "--bag", bag, "--output", output)
    before = (output / "compare.json").read_text()
    assert run(*arguments) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert (output / "compare.json").read_text() == before
    assert run(*arguments, "--overwrite") == 0
    assert set(result(output)["fits"]) == {models[0]}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda m, b: {"model": ["absent.yaml"]}, ["absent.yaml"]),
        (lambda m, b: {"bag": ["absent"]}, ["absent"]),
        (lambda m, b: {"model": [m[0], m[0]]}, ["--model", "twice"]),
        (lambda m, b: {"bag": [b, b]}, ["--bag", "twice"]),
        (lambda m, b: {"extra": ["--range", "90", "99"]}, ["--range"]),
        (lambda m, b: {"extra": ["--window", "-3"]}, ["--window"]),
        (lambda m, b: {"extra": ["--window", "0.001"]}, ["--window"]),
    ],
)
def test_bad_arguments_end_with_status_2_and_one_sentence(tmp_path, bag, models, capsys, change, words):
    given = {"model": models[:1], "bag": [bag], "extra": [], **change(models, bag)}
    output = tmp_path / "out"
    assert run("--model", *given["model"], "--bag", *given["bag"], "--output", output, *given["extra"]) == 2
    message = capsys.readouterr().err.strip().splitlines()[-1]
    assert [word for word in words if word not in message] == []
    assert not (output / "compare.json").exists()


def test_a_model_of_another_robot_is_refused_with_both_names(tmp_path, bag, capsys):
    pendulum = MODELS / "dfki_viscous.yaml"
    assert run("--model", pendulum, "--bag", bag, "--output", tmp_path / "out") == 2
    message = capsys.readouterr().err
    assert "dfki_viscous.yaml" in message
    assert bag in message
    assert "/sfj/joint_states" in message


def fits_of(shared_data, tmp_path, folder, *models, options=()):
    """Angle's fit on the estimation recording of a real machine, by model."""
    recording = shared_data / "real" / folder / "estimation"
    paths = [MODELS / name for name in models]
    output = tmp_path / "out"
    assert run("--model", *paths, "--bag", recording, "--output", output, *options) == 0
    fits = result(output)["fits"]
    return [fits[str(path)][str(recording)]["j_motor.position"] for path in paths]


@pytest.mark.usefixtures("unillustrated")
def test_the_real_pendulum_lacks_gravity_and_then_coulomb_friction(shared_data, tmp_path):
    names = ("dfki_viscous.yaml", "dfki_gravity.yaml", "dfki_gravity_coulomb.yaml")
    options = ("--fit-parameters", "--range", "0", "4")
    viscous, gravity, coulomb = fits_of(shared_data, tmp_path, "dfki", *names, options=options)
    # Published with the initial state at rest: -1.5, 94.8 and 97.7 %.
    assert viscous == pytest.approx(-1.5, abs=6.0)
    assert gravity == pytest.approx(94.8, abs=3.0)
    assert coulomb == pytest.approx(97.7, abs=0.7)


@pytest.mark.usefixtures("unillustrated")
def test_the_real_pendulums_published_parameters_fit_without_any_search(shared_data, tmp_path):
    (published,) = fits_of(shared_data, tmp_path, "dfki", "dfki_gravity_coulomb.yaml")
    assert published == pytest.approx(97.7, abs=0.7)


@pytest.mark.usefixtures("unillustrated")
def test_the_real_robot_axis_fits_better_with_coulomb_friction(shared_data, tmp_path):
    viscous = shared_data / "real" / "kr300" / "model.yaml"
    without, with_friction = fits_of(
        shared_data, tmp_path, "kr300", viscous, "kr300_coulomb.yaml", options=("--fit-parameters",)
    )
    assert with_friction > without + 5.0
    assert with_friction > 95.0


def test_residuals_of_the_true_model_are_white_and_those_of_a_wrong_one_are_not():
    recording = stage_recording(seconds=12.0, band=(0.2, 12.0))
    # The stiffness of the joint is what the arm's motion depends on.
    wrong = STAGE.with_values({"stiffness": 1.2 * STAGE.parameters["stiffness"]})
    result = compare.compare({"true": STAGE, "wrong": wrong}, {"bag": recording}, window=4.0)
    white, coloured = (result.residuals[name, "bag"][1] for name in ("true", "wrong"))
    assert white.signal == "stage1_arm.position"
    assert white.outside[0] < 0.05
    # The noise levels, tuned to each model, take over what they can of the error; not all.
    assert coloured.outside[0] > 0.15
    assert coloured.rms > white.rms
