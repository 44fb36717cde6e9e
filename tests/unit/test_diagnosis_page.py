"""The page of a diagnosis: its first line, the law through the torque that is missing, and commands that can
be pasted as they stand."""

import shlex
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from stepped_machines import DT, RIGID, drive, pendulum, record, two_masses

from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sim.omni_robot import OMNI_PARAMETERS
from haptic_teleop_sim.sfj_robot import SFJ_PARAMETERS
from haptic_teleop_sysid.commands import acquire, compare, diagnose, export, verify
from haptic_teleop_sysid.diagnosis.decision.adequacy import Adequacy
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.band import motion_band
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.motion import banded
from haptic_teleop_sysid.diagnosis.report.inverse_dynamics import second_method_sentence
from haptic_teleop_sysid.diagnosis.report.next_experiment import once_calibrated
from haptic_teleop_sysid.diagnosis.report.page_law import law_curve, law_curves, law_plot
from haptic_teleop_sysid.diagnosis.report.page_lead import lead
from haptic_teleop_sysid.diagnosis.report.page_reasons import reasons
from haptic_teleop_sysid.diagnosis.report.page_steps import Origin, steps
from haptic_teleop_sysid.recordings.parameter_units import Units
from haptic_teleop_sysid.report import Page

MODEL = RIGID.with_values({"motor_inertia": 0.14, "motor_damping": 0.35})


def curve(model, effect, here):
    """The curve of one effect of a model on one record."""
    model = model.with_effects(*([] if effect in model.effects else [effect]))
    motions = [banded(here, model.rigid, motion_band([here]))]
    return law_curve(model, effect, list(model.effects), motions)


def test_dry_friction_shows_as_a_torque_against_the_direction_and_is_gone_with_its_law():
    found = curve(MODEL, Effect("coulomb_friction", "j_motor", {"torque": 0.3}), pendulum(1, coulomb=0.3))
    assert (found.quantity, found.unit) == ("motor velocity", "rad/s")
    fast = np.abs(found.centre) > 0.4 * np.max(np.abs(found.centre))
    np.testing.assert_allclose(found.before[fast], -0.3 * np.sign(found.centre[fast]), atol=0.05)
    np.testing.assert_allclose(found.law[fast], -0.3 * np.sign(found.centre[fast]), atol=0.02)
    assert found.explained > 0.95


def test_a_name_that_only_stands_in_is_drawn_too():
    friction = Effect("coulomb_friction", "j_motor", {"torque": 0.3})
    result = SimpleNamespace(final=SimpleNamespace(model=MODEL.with_effects(friction)), choices=())
    stands_in = {"effects": [{"effect": friction.effect, "location": friction.location}]}
    records = [pendulum(1, coulomb=0.3)]
    assert law_curves(result, records) == []
    (found,) = law_curves(result, records, stands_in)
    assert found.name == "coulomb_friction at j_motor" and found.explained > 0.95


def test_gravity_beside_friction_shows_by_itself_against_the_angle():
    gravity = Effect("gravity", "j_motor", {"torque": 2.0})
    friction = Effect("coulomb_friction", "j_motor", {"torque": 0.3})
    model = MODEL.with_effects(friction, gravity)
    found = curve(model, gravity, pendulum(1, coulomb=0.3, weight=2.0))
    assert found.quantity == "motor angle"
    np.testing.assert_allclose(found.before, -2.0 * np.sin(found.centre), atol=0.12)
    assert found.explained > 0.97


def test_a_law_of_twice_the_size_leaves_as_much_missing_as_before():
    wrong = Effect("coulomb_friction", "j_motor", {"torque": 0.6})
    found = curve(MODEL, wrong, pendulum(1, coulomb=0.3))
    assert found.explained < 0.2
    fast = np.abs(found.centre) > 0.4 * np.max(np.abs(found.centre))
    np.testing.assert_allclose(found.after[fast], 0.3 * np.sign(found.centre[fast]), atol=0.06)


def test_friction_of_the_arm_is_told_from_the_arms_equation():
    torque = drive(3, 2.0)
    here = record(torque, two_masses(torque, 20.0, (0.06, 0.3), (0.05, 0.02), 0.2))
    names = ("torque_constant", "stiffness", "motor_inertia", "motor_damping", "arm_inertia", "arm_damping")
    values = dict(zip(names, (1.0, 20.0, 0.06, 0.3, 0.05, 0.02), strict=True))
    model = Model("generic", "j", "flexible_joint", values)
    found = curve(model, Effect("coulomb_friction", "j_arm", {"torque": 0.2}), here)
    assert found.quantity == "arm velocity"
    fast = np.abs(found.centre) > 0.4 * np.max(np.abs(found.centre))
    np.testing.assert_allclose(found.before[fast], -0.2 * np.sign(found.centre[fast]), atol=0.06)


def test_the_plot_is_in_the_units_of_the_machine_and_has_the_law_as_a_line_of_its_own():
    found = curve(MODEL, Effect("coulomb_friction", "j_motor", {"torque": 0.3}), pendulum(1, coulomb=0.3))
    (panel,) = law_plot([found], Units("m", "N")).panels
    assert panel.unit == "N" and panel.x_label == "motor velocity (m/s)"
    assert [s.role for s in panel.series] == ["measured", "augmented", "reference"]


def made_motion(acting):
    """A record of a motion without friction that is known in full: ``acting(t, a, v)`` is what drives it,
    N·m."""
    time = DT * np.arange(10_000)
    waves = [(0.4, 1.1), (0.25, 2.7), (0.1, 6.3)]  # rad, rad/s
    angle = sum(size * np.sin(w * time) for size, w in waves)
    v = sum(size * w * np.cos(w * time) for size, w in waves)
    a = sum(-size * w**2 * np.sin(w * time) for size, w in waves)
    return record(np.asarray(acting(time, a, v)), angle[:, None], 1e-6)


INERTIA, DAMPING = 0.14, 0.35


def test_friction_that_drifts_is_drawn_over_time_with_its_law_and_when_it_is_there():
    def acting(t, a, v):
        return INERTIA * a + DAMPING * (1.0 + 1.5 * (1.0 - np.exp(-t / 6.0))) * v

    drift = Effect("friction_drift", "j_motor", {"change": 1.5, "time_constant": 6.0})
    found = curve(MODEL, drift, made_motion(acting))
    assert (found.quantity, found.unit) == ("time", "s")
    np.testing.assert_allclose(found.before, found.law, atol=0.02)
    assert found.explained > 0.99 and found.law[0] < 0.3 * found.law[-1]
    page = Page("t")
    where = [{"equation": "j_motor", "share": 1.0, "condition": "time", "intervals": []}]
    reasons(page, verdict("identified", [finding()]), content(where=where), [found])
    told = page.sections[0].blocks[-1].rows[0][-1]
    begin, end = map(float, told.removesuffix(" s").split("–"))
    assert 1.0 < begin < 9.0 and 17.0 < end < 20.0, told
    (panel,) = law_plot([found], Units()).panels
    assert panel.x_label == "time (s)" and "in the direction of the law" in panel.title


def test_a_load_and_a_gain_that_change_are_drawn_over_time_too():
    load = Effect("payload_change", "j_motor", {"time": 12.0, "inertia": 0.1})
    found = curve(MODEL, load, made_motion(lambda t, a, v: (INERTIA + 0.1 * (t > 12.0)) * a + DAMPING * v))
    early, late = found.centre < 11.0, found.centre > 13.0
    assert found.quantity == "time" and found.explained > 0.98
    assert np.max(np.abs(found.before[early])) < 0.05 * np.min(found.before[late])
    assert found.there is not None and found.there[0] == pytest.approx(12.5, abs=1.0)
    drift = Effect("gain_drift", "j_actuator", {"change": -0.3, "time_constant": 5.0})

    def weaker(t, a, v):
        return (INERTIA * a + DAMPING * v) / (1.0 - 0.3 * (1.0 - np.exp(-t / 5.0)))

    found = curve(MODEL, drift, made_motion(weaker))
    assert found.quantity == "time" and found.explained > 0.98


def test_a_late_actuator_is_drawn_against_how_fast_its_input_changes():
    late = Effect("input_delay", "j_actuator", {"delay": 0.02})
    found = curve(MODEL, late, made_motion(lambda t, a, v: np.roll(INERTIA * a + DAMPING * v, -10)))
    assert (found.quantity, found.unit) == ("rate of the input torque", "N*m/s")
    np.testing.assert_allclose(found.before, -0.02 * found.centre, atol=0.01)
    assert found.explained > 0.95


def finding(confidence=0.97, alternatives=()):
    return {
        "effect": "coulomb_friction",
        "location": "stage1_motor",
        "parameters": {"torque": {"value": 0.4123, "std": 0.0101, "unit": "N*m"}},
        "confidence": confidence,
        "alternatives": list(alternatives),
        "because": "A dry friction opposes the motion.",
    }


def content(robot="sfj", joint="stage1", excitation=None, **changes):
    """What diagnosis.json holds, as far as the first lines and the commands need it."""
    fits = {part: {"stage1_motor.velocity": 61.2} for part in ("estimation", "validation")} | {"test": {}}
    better = {part: dict.fromkeys(found, 97.3) for part, found in fits.items()}
    return {
        "inverse_dynamics": None,
        "robot": robot,
        "joint": joint,
        "verdict": "identified",
        "findings": [finding()],
        "fit": {"given": fits, "baseline": fits, "augmented": better},
        "worse_than_given": None,
        "augmented_model": {"holds": "augmented", "what": "your structure, with what was found"},
        "parameters_moved": [],
        "adequacy": None,
        "where": [
            {
                "equation": "stage1_motor",
                "share": 0.83,
                "condition": "sign of motor velocity",
                "intervals": [[12.1, 13.4]],
            }
        ],
        "next_experiment": {
            "why": "separates A from B",
            "signal_generator": excitation or {},
            "expected_discrimination": 0.9,
        },
    } | changes


def verdict(kind, findings, where=(), adequacy=None):
    return SimpleNamespace(kind=kind, findings=findings, where=list(where), adequacy=adequacy)


def first_line(kind, findings, **changes):
    page = Page("t")
    told = content(verdict=kind, findings=findings, **changes)
    lead(page, verdict(kind, findings, told["where"]), told)
    return page


def test_an_input_of_the_opposite_sign_is_the_first_line_and_its_remedy_the_next_step():
    turned = {"what": "the input seems to have the opposite sign", "remedy": "reverse it"}
    status, happened, todo = first_line("unknown", [], input_sign=turned).conclusion
    assert (status, todo) == ("bad", "reverse it.")
    assert happened.startswith("The input seems to have the opposite sign. ")


def test_the_first_line_names_the_physics_with_its_size_error_and_unit_and_says_what_to_do():
    page = first_line("identified", [finding()])
    status, happened, todo = page.conclusion
    assert status == "good" and "simulate" in todo
    assert "coulomb_friction at stage1_motor (torque 0.412 ± 0.010 N·m)" in happened
    assert ("61.2 → 97.3 %", "fit of stage1_motor.velocity") in [figure[:2] for figure in page.figures]


def test_a_name_of_which_nobody_is_sure_is_said_to_be_probable():
    status, happened, _ = first_line("identified", [finding(0.58)]).conclusion
    assert status == "fair" and happened.startswith("The missing physics probably has a name")


def test_a_name_below_70_percent_is_not_relied_on_and_one_above_is_simulated_with():
    unsure, sure = (first_line("identified", [finding(c)]).conclusion[2] for c in (0.69, 0.7))
    assert unsure.startswith("do not rely on the name yet") and "separates A from B" in unsure
    assert sure.startswith("simulate with it")


def test_a_name_with_which_your_own_model_is_better_is_said_to_show_nothing():
    page, found = Page("t"), Adequacy(1.0, 1.0, random_left=True, worse=True)
    told = content(verdict="unknown", findings=[finding(0.69)])
    lead(page, verdict("unknown", [finding(0.69)], told["where"], found), told)
    happened = page.conclusion[1]
    assert happened.startswith("What is missing resembles coulomb_friction at stage1_motor")
    assert "worse than by your own model" in happened
    # Where much is left beside it, that is said instead.
    lead(page, verdict("unknown", [finding(0.4)], told["where"], Adequacy(0.4, 0.4, worse=True)), told)
    assert page.conclusion[1].startswith("Part of what is missing is probably")


def test_a_recording_that_is_mostly_holes_is_said_in_the_first_lines():
    little = "only 3 of its 30 s are used: it is cut apart"
    seen = {"good": ["it is cut apart at its holes"], "poor": [little]}
    (told,) = [c for c in first_line("unknown", [], recordings=seen).verdicts if "cut apart" in c[1]]
    assert told == ("bad", f"poor: {little}. Record it again without holes.")


def test_what_is_asked_about_a_recording_stands_among_the_first_lines():
    asked = "joint.position, declared rad, turns by 44.9 turns: are these degrees?"
    seen = {"good": ["it is cut apart at its holes"], "odd": [asked]}
    told = [c for c in first_line("unknown", [], recordings=seen).verdicts if "odd: " in c[1]]
    assert told == [("fair", f"odd: {asked}")]


def test_an_encoder_whose_error_is_known_is_calibrated_before_more_is_recorded():
    experiment = once_calibrated("stage1_motor_encoder")
    todo = first_line("unknown", [], next_experiment=experiment, reading_error={}).conclusion[2]
    assert todo.startswith("calibrate stage1_motor_encoder, or subtract")


def test_a_law_that_recordings_suggest_is_read_before_more_is_recorded():
    todo = first_line("unknown", [], torque_map={"law": {"file": "suggested_effect.py"}}).conclusion[2]
    assert todo.startswith("read the law in suggested_effect.py") and "separates A from B" in todo
    assert first_line("unknown", [], torque_map={"law": None}).conclusion[2].startswith("record the next")


def test_recordings_that_no_model_follows_come_before_any_name():
    odd = {"recordings": ["two"], "what": "no model follows two", "remedy": "see whether it has the units"}
    status, happened, todo = first_line("identified", [finding()], recordings_apart=odd).conclusion
    assert status == "bad" and happened.startswith("No model follows two. The missing physics")
    assert todo.startswith("see whether it has the units. Then: simulate with it")


def test_what_cannot_be_told_apart_and_what_has_no_name_send_for_the_next_experiment():
    other = {"effect": "stribeck_friction", "location": "stage1_motor", "confidence": 0.45}
    status, happened, todo = first_line("ambiguous", [finding(0.55, [other])]).conclusion
    assert status == "fair" and "separates A from B" in todo
    assert "coulomb_friction at stage1_motor or stribeck_friction at stage1_motor" in happened
    status, happened, todo = first_line("unknown", [], doubt="it hums").conclusion
    assert status == "fair" and "depends on sign of motor velocity" in happened and "record" in todo


def test_what_is_sure_beside_what_cannot_be_told_apart_comes_first():
    other = {"effect": "spring_to_ground", "location": "stage1_motor", "confidence": 0.4}
    open_ = {**finding(0.6, [other]), "effect": "gravity"}
    _, happened, _ = first_line("ambiguous", [finding(), open_]).conclusion
    sure, _, rest = happened.partition(". Beside it these recordings cannot tell ")
    assert "coulomb_friction at" in sure and "gravity" not in sure
    assert rest.startswith("gravity at") and "spring_to_ground at" in rest and "coulomb" not in rest


def test_names_of_which_nobody_is_sure_are_told_as_not_told_apart_however_unsure():
    other = {"effect": "spring_to_ground", "location": "stage1_motor", "confidence": 0.1}
    _, happened, _ = first_line("ambiguous", [finding(0.1, [other])]).conclusion
    _, _, names = happened.partition("cannot tell ")
    assert names == "coulomb_friction at stage1_motor or spring_to_ground at stage1_motor apart."


def test_where_no_physics_is_missing_the_first_line_says_which_numbers_are_off():
    off = {"parameter": "motor_inertia", "given": 0.05, "value": 0.0634, "std": 0.0012, "unit": "kg*m^2"}
    held = {"holds": "baseline", "what": "your structure, re-estimated"}
    page = first_line("no_mismatch", [], parameters_moved=[off], augmented_model=held)
    status, happened, todo = page.conclusion
    assert status == "fair" and "motor inertia 0.05 → 0.0634 ± 0.0012 kg·m²" in happened
    assert "take the new numbers over" in todo
    assert page.render().count("motor inertia") == 1
    status, happened, todo = first_line("no_mismatch", [], augmented_model=held).conclusion
    assert status == "good" and "nothing is missing" in happened and todo.startswith("nothing")


def test_that_your_own_model_is_better_stands_before_everything_else():
    worse = {"models": {"augmented": {}}, "sentence": "Worse than your own model on the test recordings"}
    held = {"holds": "given", "what": "your own model as it came"}
    page = first_line("identified", [finding()], worse_than_given=worse, augmented_model=held)
    status, happened, todo = page.conclusion
    assert status == "bad" and happened.startswith("Worse than your own model") and "keep your model" in todo


def test_what_was_found_comes_first_where_only_the_structure_without_it_is_worse():
    worse = {"models": {"baseline": {}}, "sentence": "Worse than your own model on the validation recordings"}
    held = {"holds": "augmented", "what": "your structure, re-estimated, with what was found"}
    page = first_line("identified", [finding()], worse_than_given=worse, augmented_model=held)
    status, happened, _ = page.conclusion
    assert status == "fair" and happened.startswith("The missing physics has a name")
    assert "Worse" not in happened
    assert page.render().count("Worse than your own model on the validation recordings.") == 1


def test_what_is_worse_comes_first_where_no_model_has_what_was_found():
    """A wheel's friction beside something unknown: the re-estimate was worse, only a note said so."""
    worse = {"models": {"baseline": {}}, "sentence": "Worse than your own model on the validation recordings"}
    held = {"holds": "given", "what": "your own model as it came"}
    page = first_line("unknown", [finding()], worse_than_given=worse, augmented_model=held)
    status, happened, _ = page.conclusion
    assert status == "bad" and happened.startswith("Worse than your own model")


def test_the_page_says_where_under_which_condition_and_when():
    page = Page("t")
    reasons(page, verdict("identified", [finding()]), content(), [])
    html = page.render()
    for told in ("stage1_motor", "sign of motor velocity", "12.1–13.4 s", "83 %", "0.412 ± 0.010 N·m"):
        assert told in html
    # What findings explain of the missing torque is a quantity of its own.
    assert "share of the gain in log-likelihood" in html and "share of what is missing" not in html
    assert "N*m" not in html


@pytest.mark.parametrize(("confidence", "told"), [(0.69, True), (0.6, False)])
def test_a_confidence_that_is_held_down_by_what_is_left_says_so(confidence, told):
    page = Page("t")
    answer = verdict("identified", [finding(confidence)], adequacy=Adequacy(torque=0.83, free_run=0.9))
    reasons(page, answer, content(), [])
    sentence = "limited to 69 %: coulomb_friction explains 83.0 % (mean square) of what is missing."
    assert (sentence in page.render()) == told


def test_names_that_explain_nearly_all_torque_are_told_why_they_are_not_surer():
    page = Page("t")
    much = Adequacy(torque=0.99, free_run=0.987, nearly_all_torque=True)
    reasons(page, verdict("identified", [finding(much.surest)], adequacy=much), content(), [])
    html = page.render()
    assert "explains 98.7 % (mean square) of what is missing, but predictions of the next sample ask" in html


def test_a_small_effect_beside_random_torque_is_told_what_holds_it_down():
    page = Page("t")
    beside_chance = Adequacy(torque=0.2, free_run=0.3, random_left=True)
    answer = verdict("identified", [finding(beside_chance.surest)], adequacy=beside_chance)
    reasons(page, answer, content(), [])
    html = page.render()
    assert "Confidence is limited to 69 %: what is named explains little beside torque" in html
    assert "(mean square) of what is missing" not in html


def test_a_name_beside_which_a_free_curve_explains_more_is_told_so():
    page = Page("t")
    outdone = Adequacy(torque=1.0, free_run=1.0, recovered=0.7)
    answer = verdict("identified", [finding(outdone.surest)], adequacy=outdone)
    reasons(page, answer, content(), [])
    html = page.render()
    assert "limited to 69 %: a free curve explains more" in html
    assert "have 70 % (mean square)" in html
    assert "of what is missing" not in html


def test_the_most_that_is_said_is_told_to_be_that():
    page = Page("t")
    reasons(page, verdict("identified", [finding(0.95)], adequacy=Adequacy(1.0, 1.0)), content(), [])
    assert "95 % is the most that is said" in page.render()


EXCITATION = {"joint": "stage1", "signal.multisine.rms": 0.2}
PARSERS = {
    "compare": compare._parser,
    "export": export._parser,
    "acquire": acquire._parser,
    "diagnose": diagnose._parser,
}
LOGS = (("logs/learn one", "a"), ("logs/check one", "b"))


@pytest.mark.parametrize(
    ("robot", "joint", "table", "excitation"),
    [
        ("sfj", "stage1", SFJ_PARAMETERS, EXCITATION),
        ("sfj", "stage1", SFJ_PARAMETERS, None),
        ("omni", "omni_y", OMNI_PARAMETERS, EXCITATION),
        ("generic", "j2", None, EXCITATION),
        ("generic", "j2", None, None),
    ],
)
def test_each_command_is_one_that_its_program_takes(robot, joint, table, excitation, tmp_path):
    page, output = Page("t"), tmp_path / "a folder"
    learn, check = LOGS
    scenario = None if table is None or excitation is None else output / "scenario.yaml"
    origin = Origin(
        "my models/lab.yaml", learn, check, check, output, scenario=scenario, windows=(4.0, 4.0)
    )
    steps(page, content(robot, joint, excitation), origin)
    assert not any("`" in what for what, _ in page.sections[0].blocks[0].rows), "a page sets no code in text"
    rows = page.sections[0].blocks[0].rows
    driven = table is not None and excitation is not None
    assert bool(rows[-1][1]) == driven, "a command that reads what no command made fails"
    lines = [[shlex.split(line) for line in told.splitlines()] for _, told in rows]
    assert all(words[0] == "haptic-teleop" for commands in lines for words in commands)
    (simulate, *looked), (compared,), recorded = lines
    if scenario is not None:
        assert simulate[1:4] == ["lockstep", str(scenario), "--record"]
        assert verify._parser().parse_args(looked[0][2:]).bag == simulate[4:]
    elif table is None:
        assert PARSERS["export"]().parse_args(simulate[2:]).to == "python"
    else:
        assert simulate[1] == f"{robot}_sim" and simulate[2:4] == ["--ros-args", "-p"]
        key, _, path = simulate[4].partition(":=")
        assert key in table.defaults() and Path(path) == output / "augmented_model.yaml"
    taken = PARSERS["compare"]().parse_args(compared[2:])
    assert taken.model == ["my models/lab.yaml", str(output / "augmented_model.yaml")]
    assert taken.bag == ["logs/check one", "b"]
    assert taken.window == 4.0, "the windows of the page, or the command says something else"
    told = rows[-1][0]
    assert ("MOVES THE ROBOT" in told) == driven, "what is pasted is no simulation"
    if not driven:
        assert "added to --estimation" in told
        return
    # The recording is diagnosed with those that there are.
    words, diagnosed = recorded
    taken = PARSERS["diagnose"]().parse_args(diagnosed[2:])
    assert taken.model == ["my models/lab.yaml"] and taken.validation == list(check)
    assert taken.estimation == [*learn, str(output / "next_recording")]
    taken = PARSERS["acquire"]().parse_args(words[2:])
    assert taken.config == str(output / "next_experiment.yaml")
    assert taken.output == str(output / "next_recording")


def test_what_a_second_method_says_for_and_against_stands_beside_how_sure_it_is():
    def said(own, named, from_here=False):
        effects = [{"effect": e, "location": p} for e, p in own]
        agrees = set(own) == set(named) if own else None
        found = {"agrees": agrees, "verdict_from_here": from_here, "groups": [{"effects": effects}]}
        findings = [{"effect": e, "location": p} for e, p in named]
        return second_method_sentence({"inverse_dynamics": found, "findings": findings})

    gap, drag, pull = ("backlash", "j"), ("quadratic_drag", "m"), ("gravity", "m")
    assert said([gap], [gap]).endswith("names the same.")
    assert "made this answer" in said([gap], [gap], from_here=True)
    assert "names the same, and beside it quadratic_drag at m" in said([gap, drag], [gap])
    assert "names quadratic_drag at m instead: take the answer with care" in said([drag], [gap])
    assert "names less instead" in said([gap], [gap, pull])
    assert "names nothing" in said([], [gap])
    assert "failed" in second_method_sentence({"inverse_dynamics": None, "findings": []})
