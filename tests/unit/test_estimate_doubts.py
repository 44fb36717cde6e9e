"""What `estimate` says of its own numbers where the model leaves physics out, and where recordings do not
determine a parameter: in the verdict, in the table, in the files."""

import html
import json
import shlex
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from identification_plants import STAGE, off, stage_recording

from haptic_teleop_control.recording import write_recording
from haptic_teleop_sim.model import Effect, load_model
from haptic_teleop_sysid.commands.diagnose import _parser as diagnose_arguments
from haptic_teleop_sysid.commands.estimate import main
from haptic_teleop_sysid.diagnosis.report.columns import column, moved
from haptic_teleop_sysid.diagnosis.report.summary import moved_words
from haptic_teleop_sysid.estimation.noise import NoiseModel
from haptic_teleop_sysid.estimation.residuals import correlations, depends_on_input
from haptic_teleop_sysid.recordings.relative_scale import relative_to
from haptic_teleop_sysid.report import relative, with_error
from haptic_teleop_sysid.runs.estimation_doubts import _shaken
from haptic_teleop_sysid.runs.followed import of_mean, of_worst, worse
from haptic_teleop_sysid.runs.told_roles import told_role
from haptic_teleop_sysid.runs.undetermined import what_determines, without_scale

pytestmark = pytest.mark.usefixtures("unillustrated")


def estimated(tmp_path, capsys, *arguments):
    """What is said on the terminal (in one line), estimate.json, the page's text, and the folder."""
    assert main([*map(str, arguments), "--output", str(tmp_path / "out")]) == 0
    told = capsys.readouterr().out
    content = json.loads((tmp_path / "out" / "estimate.json").read_text())
    page = html.unescape((tmp_path / "out" / "report.html").read_text())
    return told, content, page, tmp_path / "out"


def by_name(content):
    return {row["name"]: row for row in content["parameters"]}


def test_a_model_without_the_robots_friction_is_doubted_though_its_predictors_agree(
    tmp_path, capsys, repository
):
    """The tutorial's stage 2: `compare` calls such a fit poor and sends the model to `diagnose`."""
    example = repository / "docs" / "examples" / "stage2"
    told, content, page, folder = estimated(
        tmp_path, capsys, "--model", example / "model.yaml", "--bag", example / "learn",
        "--validation", example / "check",
    )  # fmt: skip
    # Whoever takes the file into a scenario reads it there, too.
    assert "physics may be missing" in (folder / "model.yaml").read_text().split("haptic_teleop_model")[0]
    assert told_role(folder / "model.yaml") == "re-estimated"
    assert content["problems"] == [] and content["disagreement"] == {}
    assert "simulate with it" not in told and "which is poor" in told
    (command,) = [line for line in told.splitlines() if line.startswith("  haptic-teleop ")]
    diagnose_arguments().parse_args(shlex.split(command)[2:])
    assert "are not white" in told and "motor_damping are correlated by +1.00" in told
    assert [doubt["status"] for doubt in content["doubts"]] == ["fair", "fair"]
    for row in by_name(content).values():
        if row["std"] is not None:
            assert row["at_least"] and row["interval"] is None
    assert "at least 0.18" in told and "at least 0.18" in page
    assert "intervals of 95 %" not in page and "errors are larger than the standard errors" in page


@pytest.mark.parametrize(("luck", "doubted"), [(0.2, True), (0.05, False)])
def test_a_model_that_needs_much_random_torque_is_doubted(luck, doubted):
    """Friction may pass for it although the fit is fair."""
    rms, constant = 0.12, STAGE.parameters["torque_constant"]
    noise = NoiseModel(luck * constant * rms, 1e-4, 1e-4, 1e-4)
    found = SimpleNamespace(fit=SimpleNamespace(noise=noise), model=STAGE)
    data = {"a": SimpleNamespace(input=rms * np.ones(10)), "b": SimpleNamespace(input=np.zeros(10))}
    result = SimpleNamespace(estimate=found, data=data, validation=("b",))
    said = [doubt.sentence for doubt in _shaken(result)]
    assert bool(said) == doubted and all("20 % of the input's" in one for one in said)
    assert list(_shaken(SimpleNamespace(estimate=SimpleNamespace(fit=None)))) == []


def test_a_right_model_is_believed_and_what_the_stiffness_makes_is_said(tmp_path, capsys):
    model = tmp_path / "model.yaml"
    off(STAGE, 1).save(model)
    bags = [
        write_recording(tmp_path / f"bag{s}", r.topics, {}, r.experiment)
        for s, r in ((s, stage_recording(seed=s, seconds=8.0)) for s in (1, 2))
    ]
    told, content, page, _ = estimated(
        tmp_path, capsys, "--model", model, "--bag", bags[0], "--validation", bags[1]
    )
    assert content["doubts"] == [] and "ok: 5 parameters" in told
    arm = by_name(content)["arm_inertia"]
    assert arm["relative_to"] == "stiffness" and arm["interval"] is not None and not arm["at_least"]
    (line,) = [line for line in told.splitlines() if "arm_inertia" in line]
    assert "0.1700" in line and "< 0.0001" in line
    assert "relative to the stiffness" in page and "intervals of 95 %" in page


def test_the_scale_of_a_fit_is_that_of_compare():
    assert [of_mean(p) for p in (95.0, 87.4, 60.0, -np.inf)] == ["good", "fair", "bad", "bad"]
    assert of_worst(95.0) is None
    assert [of_worst(p) for p in (75.0, 63.8, -3.0)] == [
        ("good", "fair"), ("fair", "poor"), ("bad", "no better than a constant"),
    ]  # fmt: skip
    assert worse("good", "fair") == "fair" and worse("bad", "good") == "bad"


def test_errors_that_past_inputs_explain_are_told_from_others():
    random = np.random.default_rng(1)
    u, noise = random.standard_normal(4000), random.standard_normal(4000)
    late = np.convolve(u, np.full(12, 0.3))[: len(u)]
    assert depends_on_input(correlations(noise + late, u, 50))
    assert not depends_on_input(correlations(noise, u, 50))


def test_what_is_known_relative_to_a_fixed_parameter_only():
    assert {n: relative_to(STAGE, n) for n in STAGE.free_parameters()} == dict.fromkeys(
        STAGE.free_parameters(), "stiffness"
    )
    # With two fixed, the arm's equation alone still has a scale of its own.
    both = replace(STAGE, fixed=("stiffness", "torque_constant"))
    assert relative_to(both, "arm_inertia") == "stiffness" and relative_to(both, "motor_inertia") == ""
    friction = Effect("coulomb_friction", "stage1_arm", {"torque": 0.1})
    held = replace(both.with_effects(friction), fixed=(*both.fixed, "stage1_arm.coulomb_friction.torque"))
    assert relative_to(held, "arm_inertia") == ""
    free = replace(STAGE, fixed=())
    assert relative_to(free, "arm_inertia") == "" and relative_to(STAGE, "stiffness") == ""
    # A torque constant of 1: the input is the torque.
    plain = replace(STAGE.with_values({"torque_constant": 1.0}), fixed=("torque_constant",))
    assert relative_to(plain, "motor_inertia") == ""


@pytest.mark.parametrize(
    ("value", "std", "told"),
    [
        (0.16999959, 3.6e-7, ("0.1700", "< 0.0001")),
        (0.006968925, 4e-8, ("0.006969", "< 0.000001")),
        (8.98, 0.026, None),
        (123456.0, 1.0, ("1.235e+05", "< 1e+02")),
        (0.17, None, None),
    ],
)
def test_no_digit_beyond_the_fourth_of_what_is_relative(value, std, told):
    assert relative(value, std) == told


def test_a_diagnosis_gives_the_arm_inertia_relative_to_the_stiffness():
    given = STAGE.with_values({"arm_inertia": 0.2})
    number = replace(column(STAGE, given)["arm_inertia"], value=0.16999959, std=4e-8)
    (one,) = moved(given, {"arm_inertia": number})
    said = moved_words(one)
    assert said == "arm inertia 0.2 -> 0.1700 kg·m² (relative to the stiffness)"
    assert with_error(8.98, 0.026, "N*m/A", "stiffness") == "8.980 ± 0.026 N·m/A"


@pytest.fixture
def slow(tmp_path):
    """A log of slow motion against 0.6 N·m·s/rad, in which no inertia to speak of can show."""
    time = 1e-3 * np.arange(4000)
    w = 2.0 * np.pi * 0.5
    torque = 0.2 * np.sin(w * time)
    angle = 0.2 / 0.6 / w * (1.0 - np.cos(w * time))
    angle += 2e-4 * np.random.default_rng(3).standard_normal(len(time))
    rows = "\n".join(f"{t:.3f},{u:.9g},{q:.9g}" for t, u, q in zip(time, torque, angle, strict=True))
    path = tmp_path / "slow.csv"
    path.write_text(f"time [s],torque_1 [N·m],position_1 [rad]\n{rows}\n", encoding="utf-8")
    return path


MODEL = """haptic_teleop_model: 1
robot: generic
joint: j1
structure: rigid_body
parameters: {{torque_constant: 1.0, motor_inertia: {inertia}, motor_damping: 0.5}}
fixed: [torque_constant]
io:
  input: {{topic: /plant/joint_states, joint: j1, field: effort}}
  motor: {{topic: /plant/joint_states, joint: j1}}
  arm: null
"""


@pytest.mark.parametrize(("inertia", "kept"), [(4e-4, True), (0.5, False)])
def test_what_is_not_determined_keeps_its_start_unless_the_recording_contradicts_it(
    tmp_path, capsys, slow, inertia, kept
):
    model = tmp_path / "model.yaml"
    model.write_text(MODEL.format(inertia=inertia), encoding="utf-8")
    told, content, _, folder = estimated(tmp_path, capsys, "--model", model, "--bag", slow)
    assert by_name(content)["motor_inertia"]["status"] == "not determined"
    saved = load_model(folder / "model.yaml").parameters["motor_inertia"]
    assert (saved == inertia) is kept
    assert content["kept_starts"] == (["motor_inertia"] if kept else [])
    comments = [t for t in (folder / "model.yaml").read_text().splitlines() if t.startswith("#")]
    (comment,) = [t for t in comments if "motor_inertia" in t]
    assert "motor_inertia cannot be determined" in comment
    assert ("keeps the start value, 0.0004" if kept else "the start value fits worse") in comment
    assert "1 parameter of j1 estimated" in told
    assert (
        "Record quicker motion, with higher frequencies in the signal, or hold motor_inertia with --fix"
        in told
    )
    assert by_name(content)["motor_damping"]["value"] == pytest.approx(0.6, rel=0.01)


def test_the_experiment_that_determines_a_parameter_is_named():
    friction = STAGE.with_effects(Effect("coulomb_friction", "stage1_motor", {"torque": 0.1}))
    assert "higher frequencies" in what_determines(STAGE, "motor_inertia")
    assert "stiffness" in what_determines(STAGE, "stiffness")
    assert "reversals" in what_determines(friction, "stage1_motor.coulomb_friction.torque")


def test_torques_without_a_scale_are_told_before_what_follows_from_it(tmp_path, capsys):
    loose = replace(STAGE, fixed=())
    assert without_scale(loose) and not without_scale(STAGE)
    friction = loose.with_effects(Effect("coulomb_friction", "stage1_motor", {"torque": 0.05}))
    assert without_scale(friction)
    assert not without_scale(replace(friction, fixed=("stage1_motor.coulomb_friction.torque",)))
    assert not without_scale(replace(friction, fixed=("torque_constant",)))
    payload = loose.with_effects(Effect("payload_change", "stage1_arm", {"time": 3.0, "inertia": 0.05}))
    held = "stage1_arm.payload_change.inertia"
    assert without_scale(payload) and not without_scale(replace(payload, fixed=(held,)))
    zero = replace(loose, parameters={**loose.parameters, "arm_damping": 0.0}, fixed=("arm_damping",))
    assert without_scale(zero), "nothing is no scale"
    bag = write_recording(tmp_path / "bag", stage_recording(seconds=6.0).topics, {})
    loose.save(tmp_path / "model.yaml")
    told, *_ = estimated(tmp_path, capsys, "--model", tmp_path / "model.yaml", "--bag", bag)
    assert "bad: Nothing fixes the scale of the torques" in told and "--fix torque_constant" in told
