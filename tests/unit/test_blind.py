"""The blind benchmark: its physics against closed forms, its seal, its scores on results written by hand."""

import ast
import json
import math
import random
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from blind_rigs import BA, BM, FAKE, JA, JM, KT, K
from scipy.interpolate import CubicSpline
from scipy.linalg import expm

import haptic_teleop_sysid.blind as blind_package
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.recording import read_recording
from haptic_teleop_sysid.blind import command
from haptic_teleop_sysid.blind.bags import record
from haptic_teleop_sysid.blind.calibration import calibration, calibration_error
from haptic_teleop_sysid.blind.cases import draw_case
from haptic_teleop_sysid.blind.detect import Column, whiten, whitener
from haptic_teleop_sysid.blind.effects import BY_NAME, PLACES
from haptic_teleop_sysid.blind.physics import integrate
from haptic_teleop_sysid.blind.planting import _read_at, contribution, run, shares_of
from haptic_teleop_sysid.blind.robot import Robot, disturbance
from haptic_teleop_sysid.blind.runner import parse_cases, plan
from haptic_teleop_sysid.blind.scoring import score_case
from haptic_teleop_sysid.blind.sealing import SEALED, open_labels, seal
from haptic_teleop_sysid.blind.slots import INDEX, empty
from haptic_teleop_sysid.blind.summary import summarise, wilson

ROBOT = np.array([KT, K, JM, BM, JA, BA, 0.002, 1.534e-5, 2.462e-4, 0.94])


def moved(slots: dict[str, float], current: np.ndarray, robot: np.ndarray = ROBOT, gate=None) -> np.ndarray:
    """The integrator in open loop without noise."""
    n = len(current)
    e = empty()
    for name, value in slots.items():
        e[INDEX[name]] = value
    calm = np.zeros(n)
    if gate is None:
        gate = np.column_stack([np.ones(n), calm, calm])
    still, nowhere = np.zeros((n + 1, 2)), np.zeros((0, 6))
    return integrate(robot, e, 0, np.zeros(8), current, still, gate, calm, calm, 100, False, nowhere, False)


def test_the_linear_robot_follows_the_matrix_exponential() -> None:
    rng = np.random.default_rng(1)
    current = np.repeat(rng.uniform(-0.3, 0.3, 20), 25)
    out = moved({}, current)
    a = np.array([[0, 0, 1, 0], [0, 0, 0, 1], [-K / JM, K / JM, -BM / JM, 0], [K / JA, -K / JA, 0, -BA / JA]])
    block = np.zeros((5, 5))
    block[:4, :4], block[2, 4] = a, KT / JM
    step = expm(block * 0.002)
    x, path = np.zeros(4), []
    for u in current:
        path.append(x)
        x = step[:4, :4] @ x + step[:4, 4] * u
    assert np.max(np.abs(out[:, :4] - path) / np.std(path, axis=0)) < 1e-4


@pytest.mark.parametrize("slots", [{}, {"cubic": 40.0}, {"gap": 0.05}, {"a_grav": 0.6}])
def test_without_damping_the_energy_given_by_a_push_stays(slots: dict[str, float]) -> None:
    free = ROBOT.copy()
    free[3] = free[5] = 0.0
    n = 2000
    gate = np.column_stack([np.ones(n), np.zeros(n), np.zeros(n)])
    gate[:100, 2] = 0.3
    out = moved(slots, np.zeros(n), free, gate)
    d = out[:, 0] - out[:, 1]
    spring = 0.5 * K * d**2 + 0.25 * slots.get("cubic", 0.0) * d**4
    if "gap" in slots:
        spring = 0.5 * K * np.maximum(np.abs(d) - 0.5 * slots["gap"], 0.0) ** 2
    weight = slots.get("a_grav", 0.0) * (1.0 - np.cos(out[:, 1]))
    energy = 0.5 * JM * out[:, 2] ** 2 + 0.5 * JA * out[:, 3] ** 2 + spring + weight
    late = energy[120:]
    assert late[0] > 1e-3
    assert np.ptp(late) < 2e-3 * late.mean()


def test_dry_friction_holds_below_its_level_and_costs_it_above() -> None:
    slots = {"m_fric_pos": 0.8, "m_fric_neg": 0.8, "m_bristle": 6e-5}
    held = moved(slots, np.full(1500, 0.5 * 0.8 / KT))
    assert np.max(np.abs(held[:, 0])) < 2e-4
    sliding = moved(slots, np.full(4000, 0.3))
    assert sliding[-1, 2] == pytest.approx((KT * 0.3 - 0.8) / (BM + BA), rel=2e-3)


def test_a_delay_of_whole_samples_shifts_the_response_by_them() -> None:
    current = 0.2 * np.sin(np.arange(1500) * 0.02)
    late = moved({"delay": 0.014}, current)
    assert np.allclose(late[7:, :4], moved({}, current)[:-7, :4], atol=1e-12)


def test_a_delay_between_two_integration_steps_is_not_rounded() -> None:
    current = 0.2 * np.sin(np.arange(2000) * 0.02)
    late = moved({"delay": 0.00113, "m_sensor_delay": 0.00227}, current)
    calm = moved({}, current)
    time = np.arange(2000) * 0.002
    path = CubicSpline(time, calm[:, 0])
    at_actuator, shown = path(time - 0.00113), path(time - 0.00113 - 0.00227)
    speed = np.std(calm[:, 2])  # one integration step would be 2e-5 s x speed
    assert np.max(np.abs(late[:, 0] - at_actuator)[50:]) < 2e-6 * speed + 1e-6
    assert np.max(np.abs(late[:, 6] - shown)[50:]) < 2e-6 * speed + 1e-6


def test_a_skewed_reading_is_where_the_axis_was_under_a_lively_command_too() -> None:
    """The chord between two readings of such a motion is off by more than an encoder's step: two delays of a
    force loop were better explained by a lag."""
    current = np.random.default_rng(2).uniform(-0.3, 0.3, 2000)
    error = {"m_ecc_amp": 1e-3, "m_ecc_order": 5.0}
    late, calm = moved(error | {"m_sensor_delay": 0.00097}, current), moved(error, current)
    shown = _read_at(calm[:, 6], calm[:, 0], calm[:, 2], 0.00097)
    time = np.arange(2000) * 0.002
    chord = np.interp(time - 0.00097, time, calm[:, 6])
    assert np.max(np.abs(late[:, 6] - shown)[5:]) < 1e-6
    assert np.max(np.abs(late[:, 6] - chord)[5:]) > 1e-5


def test_a_lag_ends_where_the_exponential_does() -> None:
    out = moved({"lag": 0.05}, np.full(200, 0.2))
    start, end = 0.1, 0.102
    mean = 0.2 * (1 - 0.05 / 0.002 * (math.exp(-start / 0.05) - math.exp(-end / 0.05)))
    assert out[50, 12] == pytest.approx(mean, rel=1e-3)


def test_the_two_encoder_scales_are_one_and_the_same_to_any_observer() -> None:
    current = 0.2 * np.sin(np.arange(3000) * 0.01) + 0.1 * np.sin(np.arange(3000) * 0.037)
    one = moved({"m_scale": 0.02}, current)
    stronger = ROBOT.copy()
    stronger[0] *= 1.02
    other = moved({"a_scale": 1.0 / 1.02 - 1.0}, current, stronger)
    assert np.allclose(one[:, 6:8], other[:, 6:8], atol=1e-9)


def test_innovations_of_a_noisy_clean_robot_are_white_and_of_unit_variance() -> None:
    case = draw_case(2, "clean", 1, "x")
    setting = case.settings[0]
    robot = replace(setting.robot, noise_motor=0.05, noise_arm=0.01, colour_motor=0.02, colour_arm=0.05)
    setting = replace(
        setting,
        robot=robot,
        experiment=replace(setting.experiment, loop="open loop current", gains=np.zeros(8)),
    )
    push = disturbance(np.random.default_rng(3), robot, setting.samples)
    calm, noisy = run(setting, [], None), run(setting, [], None, push)
    error = Column(motor_error=noisy.motor_read - calm.motor_shown, arm_error=noisy.arm_read - calm.arm_shown)
    n = setting.samples
    white = whiten(whitener(robot), [error], n)[:, 0].reshape(3, n)[:2, 500:]
    assert np.var(white, axis=1) == pytest.approx([1.0, 1.0], rel=0.12)
    for row in white:
        assert abs(np.corrcoef(row[1:], row[:-1])[0, 1]) < 0.06


def test_every_place_of_the_contract_is_planted() -> None:
    both, encoders = {"motor", "arm"}, {"motor_encoder", "arm_encoder"}
    places = {
        "coulomb_friction stribeck_friction asymmetric_friction presliding_friction quadratic_drag": both,
        "position_dependent_friction friction_drift spring_to_ground constant_torque hard_stop": both,
        "load_dependent_friction torque_ripple": {"motor"},
        "backlash hardening_spring hysteresis joint_damping": {"joint"},
        "input_delay actuator_lag torque_saturation dead_zone gain_error gain_drift": {"actuator"},
        "torque_speed_limit": {"actuator"},
        "gravity inertial_coupling extra_flexible_mode payload_change angle_dependent_inertia": {"arm"},
        "encoder_eccentricity encoder_scale sensor_delay": encoders,
        "channel_skew": {*encoders, "actuator"},
    }
    contract = {effect: parts for effects, parts in places.items() for effect in effects.split()}
    planted: dict[str, set[str]] = {}
    for effect, part in PLACES:
        planted.setdefault(effect, set()).add(part)
    assert planted == contract
    assert set(BY_NAME) == set(contract)


def test_the_generator_shares_no_code_with_what_it_examines() -> None:
    for path in Path(blind_package.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            for name in names:
                if name.startswith("haptic_teleop_"):
                    allowed = ("haptic_teleop_control", "haptic_teleop_sysid.blind")
                    writing = ("haptic_teleop_sysid.report", "haptic_teleop_sysid.results")
                    running = ("haptic_teleop_sysid.spread",)  # who does what, no word of robots
                    assert name.startswith((*allowed, *writing, *running)), f"{path.name} imports {name}"


@pytest.mark.long
def test_the_same_seed_gives_the_same_case_and_another_seed_another() -> None:
    first, again, other = (draw_case(seed, "single", 4, "x") for seed in (5, 5, 6))
    assert first.label == again.label
    a, _ = record(first, 0)
    b, _ = record(again, 0)
    states = "/sfj/joint_states"
    assert a[states].effort is not None and b[states].effort is not None
    assert np.array_equal(a[states].effort, b[states].effort)
    assert other.label["truth_parameters"] != first.label["truth_parameters"]


def test_sizes_are_what_was_asked_for() -> None:
    case = draw_case(8, "single", 3 * len(PLACES), "x", (32.0,))
    assert case.label["truth"][0]["detectability"] == pytest.approx(32.0, rel=0.11)


def test_the_order_of_cases_says_nothing_and_their_number_is_as_asked() -> None:
    listed = plan(3, {"single": 4, "clean": 3})
    assert sorted(kind for _, kind, _ in listed) == ["clean"] * 3 + ["single"] * 4
    assert [kind for _, kind, _ in listed] != sorted(kind for _, kind, _ in listed)
    with pytest.raises(ConfigurationError, match="KIND=NUMBER"):
        parse_cases("single=3,unheard=2", ("single", "clean"))


def test_the_seal_opens_only_after_the_last_diagnosis_and_only_unchanged(tmp_path: Path) -> None:
    labels = {"case0001": {"truth": [{"effect": "backlash"}]}}
    digest = seal(labels, tmp_path, "7")
    assert b"backlash" not in (tmp_path / SEALED).read_bytes()
    with pytest.raises(ConfigurationError, match="stays closed while 1 cases wait"):
        open_labels(tmp_path, "7", ["case0001"])
    with pytest.raises(ConfigurationError, match="--seed"):
        open_labels(tmp_path, "8", [])
    assert open_labels(tmp_path, "7", [], digest) == labels
    seal({"case0001": {"truth": []}}, tmp_path, "7")
    with pytest.raises(ConfigurationError, match="digest"):
        open_labels(tmp_path, "7", [], digest)


def label_of(**changes: Any) -> dict[str, Any]:
    """A label as the generator writes it."""
    truth = {
        "effect": "coulomb_friction",
        "location": "stage1_motor",
        "parameters": {"torque": 0.4},
        "scored": ["torque"],
        "detectability": 20.0,
    }
    label = {
        "kind": "single",
        "stage": "stage1",
        "loop": "open loop current",
        "truth": [truth],
        "sets": [[["coulomb_friction", "stage1_motor"]]],
        "isolable": True,
        "trace_of": None,
        "truth_parameters": {"torque_constant": 8.0},
        "floor": {"validation": {"whole": {"stage1_motor.velocity": 95.0}}},
    }
    return {**label, **changes}


def finding(effect: str, location: str, **more: Any) -> dict[str, Any]:
    """A finding of the contract."""
    parameters = {"torque": {"value": 0.44, "std": 0.03, "unit": "N*m"}}
    return {"effect": effect, "location": location, "parameters": parameters, "confidence": 0.9, **more}


def scored(
    tmp_path: Path, label: dict[str, Any], result: dict[str, Any] | None, **ran: Any
) -> dict[str, Any]:
    """The score of a diagnosis written by hand."""
    (tmp_path / "diagnosis").mkdir(exist_ok=True)
    (tmp_path / "run.json").write_text(json.dumps({"status": "0", "seconds": 2.0, "message": "", **ran}))
    if result is not None:
        (tmp_path / "diagnosis" / "diagnosis.json").write_text(json.dumps(result))
    return score_case("case0001", label, tmp_path)


def test_a_right_name_scores_with_its_size_its_interval_and_its_gap(tmp_path: Path) -> None:
    fit = {
        "baseline": {"validation": {"stage1_motor.velocity": 55.0}},
        "augmented": {"validation": {"stage1_motor.velocity": 87.0}},
    }
    result = {"verdict": "identified", "findings": [finding("coulomb_friction", "stage1_motor")], "fit": fit}
    score = scored(tmp_path, label_of(), result)
    assert score["name_right"] and score["location_right"] and score["in_set"] and score["set_size"] == 1
    (size,) = score["parameters"]
    assert size["error"] == pytest.approx(0.1)
    assert size["covered"]  # 0.04 is less than 1.645 x 0.03
    assert score["fit"]["share"] == pytest.approx((87.0 - 55.0) / (95.0 - 55.0))
    assert not score["fit"]["harm"]


def test_a_runner_up_counts_in_an_ambiguous_verdict_and_not_in_an_identified_one(tmp_path: Path) -> None:
    other = {"effect": "coulomb_friction", "location": "stage1_motor", "confidence": 0.1}
    said = [finding("stribeck_friction", "stage1_motor", alternatives=[other])]
    sure = scored(tmp_path, label_of(), {"verdict": "identified", "findings": said})
    open_ = scored(tmp_path, label_of(), {"verdict": "ambiguous", "findings": said})
    assert not sure["in_set"] and sure["set_size"] == 1
    assert open_["in_set"] and open_["set_size"] == 2
    assert not open_["cannot_tell"]  # Stribeck is no explanation that the label allows


def test_cannot_tell_is_right_when_both_explanations_are_stated(tmp_path: Path) -> None:
    sets = [[["coulomb_friction", "stage1_motor"], ["dead_zone", "stage1_actuator"]]]
    other = {"effect": "dead_zone", "location": "stage1_actuator", "confidence": 0.4}
    said = [finding("coulomb_friction", "stage1_motor", alternatives=[other])]
    label = label_of(kind="tied", sets=sets, isolable=False)
    assert scored(tmp_path, label, {"verdict": "ambiguous", "findings": said})["cannot_tell"]
    assert not scored(tmp_path, label, {"verdict": "identified", "findings": said})["cannot_tell"]


def test_a_trace_found_is_no_false_alarm_and_anything_else_is(tmp_path: Path) -> None:
    label = label_of(kind="clean", truth=[], sets=[], isolable=False, trace_of="torque_ripple")
    quiet = scored(tmp_path, label, {"verdict": "no_mismatch", "findings": []})
    trace = scored(
        tmp_path, label, {"verdict": "identified", "findings": [finding("torque_ripple", "stage1_motor")]}
    )
    wrong = scored(
        tmp_path, label, {"verdict": "identified", "findings": [finding("backlash", "stage1_joint")]}
    )
    unknown = scored(tmp_path, label, {"verdict": "unknown", "findings": []})
    assert [s["false_alarm"] for s in (quiet, trace, wrong, unknown)] == [False, False, True, True]


def test_a_pair_counts_whole_half_and_wrong(tmp_path: Path) -> None:
    second = {**label_of()["truth"][0], "effect": "backlash", "location": "stage1_joint", "scored": []}
    label = label_of(
        kind="pair",
        truth=[*label_of()["truth"], second],
        sets=[[["coulomb_friction", "stage1_motor"]], [["backlash", "stage1_joint"]]],
    )
    one, two = finding("coulomb_friction", "stage1_motor"), finding("backlash", "stage1_joint")
    stray = finding("gravity", "stage1_arm")
    both = scored(tmp_path, label, {"verdict": "identified", "findings": [two, one]})
    half = scored(tmp_path, label, {"verdict": "identified", "findings": [one]})
    mixed = scored(tmp_path, label, {"verdict": "identified", "findings": [one, stray]})
    assert [s["all_named"] for s in (both, half, mixed)] == [True, False, False]
    assert [s["one_and_none_wrong"] for s in (both, half, mixed)] == [True, True, False]
    assert [(s["right_names"], s["named_wrong"]) for s in (both, half, mixed)] == [(2, 0), (1, 0), (1, 1)]
    pairs = summarise([both, half, mixed])["together"]["pair"]
    assert (pairs["all"]["hits"], pairs["one_and_none_wrong"]["hits"], pairs["all"]["of"]) == (1, 2, 3)
    assert pairs["right_names"]["value"] == pytest.approx(4 / 3)


@pytest.mark.long
def test_each_of_three_effects_shows_beside_the_two_others() -> None:
    case = draw_case(77, "triple", 0, "triple")
    told = case.label["truth"]
    assert len(told) == len({t["effect"] for t in told}) == len(case.label["sets"]) == 3
    assert min(t["detectability"] for t in told) >= 8.0 and case.label["isolable"]


def test_an_effect_that_lets_nothing_move_is_made_smaller() -> None:
    # This draw begins with a dead zone wider than the command.
    case = draw_case(20281128, "triple", 3, "case0001")
    assert len(case.planted) == 3 and all(one.detectability > 1.0 for one in case.planted)


def test_a_command_that_failed_or_wrote_rubbish_is_no_success(tmp_path: Path) -> None:
    crashed = scored(tmp_path, label_of(), None, status="1", message="boom")
    rubbish = scored(tmp_path, label_of(), {"verdict": "perhaps"})
    for score in (crashed, rubbish):
        assert score["verdict"] == "failed" and not score["detected"] and not score["name_right"]
    assert crashed["message"] == "boom"


def test_the_summary_holds_strong_effects_against_the_targets(tmp_path: Path) -> None:
    right = scored(
        tmp_path,
        label_of(),
        {"verdict": "identified", "findings": [finding("coulomb_friction", "stage1_motor")]},
    )
    weak = {**right, "detectability": [3.0], "detected": False, "name_right": False, "named": False}
    missed = {**right, "detected": False, "name_right": False, "named": False, "parameters": []}
    targets = summarise([right, right, weak, missed])["targets"]
    assert targets["detected"]["hits"] == 2 and targets["detected"]["of"] == 3
    assert targets["detected"]["met"] == "missed"
    assert targets["size_error"]["value"] == pytest.approx(0.1)
    assert targets["false_alarms"]["met"] == "no data"


def test_wilson_and_calibration_agree_with_numbers_worked_by_hand() -> None:
    # Wilson (1927): 81 of 263 at 95 % gives 0.2553 to 0.3662 (Newcombe 1998, table I).
    assert wilson(81, 263) == pytest.approx((0.2553, 0.3662), abs=5e-5)
    assert wilson(0, 0) == (0.0, 1.0)
    assert calibration_error([(0.9, True)] * 9 + [(0.9, False)]) == pytest.approx(0.0)
    assert calibration_error([(0.95, False)] * 2 + [(0.05, False)] * 2) == pytest.approx(0.5)


def named(confidence, right, kind="single"):
    said = ["coulomb_friction @ stage1_motor"]
    truth = said if right else ["coulomb_friction @ stage1_arm"]  # the name alone is not enough
    return {"kind": kind, "named": True, "confidence": confidence, "said": said, "truth": truth}


def test_names_that_are_right_as_often_as_stated_have_no_calibration_error_but_by_chance() -> None:
    draw = random.Random(3)
    honest = [named(c, draw.random() < c) for c in [0.35, 0.65, 0.95] * 60]
    found = calibration(honest)
    assert found["cases"] == 180 and found["ece"] > 0.0
    assert abs(found["debiased"]) < 0.03 and found["interval"][0] < 0.0 < found["interval"][1]
    # One in three of those who are quite sure is wrong: the error is the difference.
    boastful = calibration([named(1.0, i % 3 > 0) for i in range(180)])
    assert boastful["debiased"] == pytest.approx(1.0 / 3.0)
    assert boastful["interval"][0] > 0.2
    assert boastful["rows"] == [
        {"from": 0.95, "to": 1.0, "cases": 180, "stated": 1.0, "right": pytest.approx(2.0 / 3.0)}
    ]


def test_what_is_not_named_or_clean_says_nothing_of_calibration() -> None:
    silent = {"kind": "single", "named": False, "confidence": None, "said": [], "truth": ["a @ b"]}
    found = calibration([silent, named(0.9, False, kind="clean")])
    assert (found["cases"], found["ece"], found["rows"]) == (0, None, [])


@pytest.mark.long
def test_from_seed_to_report_with_a_tool_that_sees_nothing(tmp_path: Path) -> None:
    fake = tmp_path / "fake.py"
    fake.write_text(FAKE)
    output = tmp_path / "blind"
    arguments = ["--seed", "2", "--cases", "single=1,clean=1", "--levels", "32", "--jobs", "1"]
    arguments += ["--output", str(output)]
    assert command.main([*arguments, "--only", "generate"]) == 0
    recording = read_recording(next(output.glob("cases/*/estimation")))
    assert len(recording.topics["/sfj/joint_states"]) == 12000
    assert command.main([*arguments, "--only", "score"]) == 2  # sealed: nothing has been diagnosed
    assert command.main([*arguments, "--only", "score", "--partial"]) == 2
    assert command.main([*arguments, "--partial", "--resume"]) == 2  # partial runs nothing
    assert command.main([*arguments, "--resume", "--command", f"{sys.executable} {fake}"]) == 0
    result = json.loads((output / "blind.json").read_text())
    assert result["summary"]["targets"]["detected"]["hits"] == 0
    assert result["summary"]["targets"]["false_alarms"]["hits"] == 0
    assert "Targets" in (output / "report.html").read_text()
    assert command.main(arguments) == 2  # an earlier run is not overwritten unasked
    next(output.glob("cases/*/run.json")).unlink()
    assert command.main([*arguments, "--only", "score"]) == 2  # sealed until all have run
    assert command.main([*arguments, "--only", "score", "--partial"]) == 0
    assert json.loads((output / "blind.json").read_text())["cases_run"] == 1
    assert "The first 1 of these 2 have run" in (output / "table.md").read_text()


def test_noise_has_the_level_and_the_memory_that_were_drawn() -> None:
    robot = Robot("stage1", dict.fromkeys(("a",), 1.0), 0.2, 0.05, 0.05, 0.01, 0.002)
    push = disturbance(np.random.default_rng(0), robot, 200_000)
    assert np.std(push, axis=0) == pytest.approx([0.2, 0.05], rel=0.05)
    memory = np.corrcoef(push[25:, 0], push[:-25, 0])[0, 1]
    assert memory == pytest.approx(math.exp(-1.0), abs=0.03)  # one correlation time later


@pytest.mark.long
def test_what_two_effects_add_on_their_way_together_is_what_both_add() -> None:
    """Forces apart along one path: exact but for rounding where one does not act through the other."""
    for index in range(3):
        case = draw_case(77, "pair", index, "pair")
        told = list(case.planted[:2])
        together, each = shares_of(case.settings[0], told, case.scenes, case.pushes[0])
        total = contribution(case.settings[0], together)
        for what in ("motor_force", "arm_force", "motor_error", "arm_error", "current"):
            parts = [getattr(column, what) for column in each]
            scale = max(float(np.max(np.abs(part))) for part in parts) + 1e-9
            assert np.max(np.abs(sum(parts) - getattr(total, what))) < 1e-9 * scale + 1e-12
