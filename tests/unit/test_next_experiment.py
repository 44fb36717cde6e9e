"""The next experiment: a file that `acquire` runs, within the robot's limits, and a reason that says what is
still open."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from identification_plants import AXIS, STAGE, axis_recording, stage_recording
from simulated_recordings import recorded
from stepped_machines import RIGID, pendulum

from haptic_teleop_2dsfj.settings import TABLE as SFJ_TABLE
from haptic_teleop_control.acquisition import Acquisition
from haptic_teleop_control.robots import SFJ_STAGES
from haptic_teleop_omni.settings import TABLE as OMNI_TABLE
from haptic_teleop_sim.kernel import pack, simulate
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.commands.acquire import experiment_from
from haptic_teleop_sysid.diagnosis.decision.finding import finding
from haptic_teleop_sysid.diagnosis.decision.search.decide import Choice
from haptic_teleop_sysid.diagnosis.decision.search.rounds import SearchResult
from haptic_teleop_sysid.diagnosis.decision.verdict import Verdict
from haptic_teleop_sysid.diagnosis.hypotheses.explanation import Explanation
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales
from haptic_teleop_sysid.diagnosis.report.contents import disturbance, overflows
from haptic_teleop_sysid.diagnosis.report.experiment import menu, series, sharpen, simulated_experiment
from haptic_teleop_sysid.diagnosis.report.next_experiment import (
    FILE,
    SIGNAL_FILE,
    acquire_file,
    next_experiment,
    varied,
    write_experiment,
)
from haptic_teleop_sysid.estimation.noise import NoiseModel
from haptic_teleop_sysid.estimation.records import record_from
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch
from haptic_teleop_sysid.recordings.dataset import load_dataset

FRICTION = Effect("coulomb_friction", "stage1_motor", {"torque": 0.05})


@pytest.fixture(scope="module")
def stage():
    """A record of stage 1 with friction, and its fits without and with it."""
    data = load_dataset(stage_recording(STAGE.with_effects(FRICTION), seed=3, seconds=8.0), STAGE)
    record = record_from(data, commanded=True)
    return record, fit_from_scratch(STAGE, [record]), fit_from_scratch(STAGE.with_effects(FRICTION), [record])


def result_of(stage, *others, last=()):
    record, plain, fit = stage
    chosen = Explanation(fit, 300.0, 200.0, True, 0)
    choice = Choice(chosen, 1.0 - sum(p for _, p in others), others)
    return SearchResult(plain, fit, (choice,), tuple(last), recording_scales(STAGE, [record]))


def verdict_of(result, kind="identified", std=None):
    found = [finding(c, result.final, {}) for c in result.choices]
    if std is not None:
        found[0]["parameters"]["torque"]["std"] = std
    return Verdict(kind, [], found, [], [])


@pytest.mark.parametrize(
    ("model", "recording"),
    [
        (STAGE, lambda: stage_recording(seed=1, seconds=4.0)),
        (replace(STAGE, joint="stage2"), lambda: stage_recording(seed=1, seconds=4.0)),
        (AXIS, lambda: axis_recording(seed=1, seconds=4.0)),
    ],
)
def test_acquire_takes_every_setting_of_the_menu(tmp_path, model, recording):
    source = STAGE if model.robot == "sfj" else model
    record = record_from(load_dataset(recording(), source), commanded=True)
    options = menu(model, recording_scales(model, [record]), record.dt)
    assert len(options) == 12
    for option in options:
        told = {"why": "separates a from b", "signal_generator": option, "expected_discrimination": 0.9}
        path = write_experiment(tmp_path, model, told, "A")
        assert path == tmp_path / FILE
        experiment, sections = experiment_from(path)
        assert experiment.joint == model.joint
        assert {k: experiment.values[k] for k in option} == option
        assert sections["scenario"]["nodes"] == [f"{model.robot}_driver", "acquisition"]
        assert "separates a from b" in sections["scenario"]["note"]
        time = np.arange(0.0, experiment.end, 0.01)
        peak = np.max(np.abs(experiment.series(time)))
        if model.robot == "sfj":
            assert experiment.unit == "A"
            assert 0.0 < peak <= SFJ_STAGES[model.joint].recommended_current
        else:
            assert experiment.unit == "rad"
            assert 0.0 < peak < experiment.values["limit.position"]


def test_another_machine_gets_the_signal_as_a_table_and_a_stale_file_goes(tmp_path):
    (tmp_path / FILE).write_text("stale", encoding="utf-8")
    record = pendulum(1)
    option = menu(RIGID, recording_scales(RIGID, [record]), record.dt)[0]
    told = {"why": "x", "signal_generator": option, "expected_discrimination": 0.9}
    path = write_experiment(tmp_path, RIGID, told, "N")
    assert path == tmp_path / SIGNAL_FILE and not (tmp_path / FILE).exists()
    assert path.read_text().startswith("time [s],input [N]\n")
    time, signal = np.loadtxt(path, delimiter=",", skiprows=1).T
    np.testing.assert_allclose(np.diff(time), record.dt, rtol=1e-3)
    assert np.all(signal[time < option["signal.delay"]] == 0.0)
    rms = np.std(signal[time > option["signal.delay"]])
    assert rms == pytest.approx(option["signal.multisine.rms"], rel=0.2)
    assert np.max(np.abs(signal)) <= option["signal.saturation"]
    nothing = {**told, "signal_generator": {}}
    assert write_experiment(tmp_path, RIGID, nothing, "N") is None and not path.exists()
    assert write_experiment(tmp_path, STAGE, nothing, "A") is None


@pytest.mark.parametrize(
    ("condition", "words"),
    [
        ("motor angle, periodically", "two other angles"),
        ("sign of motor velocity", "at three times its speed"),
        ("input torque", "three times its size"),
        ("deflection near zero", "three times its size"),
        ("humidity", "once with much humidity"),
    ],
)
def test_what_a_torque_follows_is_varied_in_the_words_of_who_moves_the_machine(condition, words):
    assert words in varied(condition)


def test_a_simulated_experiment_stays_within_the_limits(stage):
    record, _, fit = stage
    scales = recording_scales(STAGE, [record])
    for option in menu(fit.model, scales, record.dt):
        made = simulated_experiment(fit, option, record, scales)
        if made is not None:
            assert np.max(np.abs(made.measured[:, 0])) < option["limit.position"]
        assert simulated_experiment(fit, {**option, "limit.position": 1e-6}, record, scales) is None
        too_much = {
            n: 9.0 * v if n.endswith((".rms", ".amplitude", "saturation")) else v for n, v in option.items()
        }
        assert series(fit.model, {**too_much, "signal.saturation": 9.0}, np.arange(0.0, 5.0, 0.01)) is None


def test_the_position_loop_is_simulated_as_acquire_runs_it():
    """Against the loop closed sample by sample."""
    record = record_from(load_dataset(axis_recording(seed=1, seconds=4.0), AXIS), commanded=True)
    fit = replace(fit_from_scratch(AXIS, [record]), model=AXIS)
    fit = replace(fit, noise=replace(fit.noise, motor_torque=1e-9))
    scales = recording_scales(AXIS, [record])
    option = menu(AXIS, scales, record.dt)[0]
    made = simulated_experiment(fit, option, record, scales)
    experiment = Acquisition.from_parameters(option)
    signal = experiment.series(record.dt * np.arange(len(made)))
    state = np.zeros(4)
    angle = np.empty(3000)
    for i in range(3000):
        angle[i] = state[0]
        torque = option["gain"] * (signal[i] - state[0])
        state = simulate(AXIS, np.full(2, torque), record.dt, state).states[-1]
    error = made.measured[:3000, 0] - angle[:3000]
    assert np.std(error) < 0.1 * np.std(angle)


def test_both_places_of_one_effect_are_told(stage):
    record, _, fit = stage
    other = Effect("coulomb_friction", "stage1_arm", {"torque": 0.01})
    rival = replace(fit, model=replace(fit.model, effects=(other,)))
    rival = replace(rival, free=rival.model.free_parameters())
    result = result_of(stage, (Explanation(rival, 299.0, 199.0, True, 0), 0.45))
    why = next_experiment(result, verdict_of(result, "ambiguous"), [record])["why"]
    assert "coulomb_friction at stage1_motor from coulomb_friction at stage1_arm" in why


def test_a_runner_up_is_something_left_to_separate(stage):
    record, plain, fit = stage
    drag = fit_from_scratch(
        STAGE.with_effects(Effect("quadratic_drag", "stage1_motor", {"coefficient": 0.1})), [record]
    )
    result = result_of(stage, (Explanation(drag, 290.0, 190.0, True, 0), 0.09))
    assert not result.choices[0].ambiguous
    told = next_experiment(result, verdict_of(result), [record])
    assert "coulomb_friction at stage1_motor from quadratic_drag at stage1_motor" in told["why"]
    assert "9 %" in told["why"]


def test_a_size_that_is_not_well_known_is_something_to_record_for(stage):
    record, _, fit = stage
    result = result_of(stage)
    sure = next_experiment(result, verdict_of(result), [record])
    assert sure["why"].startswith("nothing is left to separate")
    size = fit.model.parameter_values()["stage1_motor.coulomb_friction.torque"]
    told = next_experiment(result, verdict_of(result, std=0.47 * size), [record])
    assert "torque of coulomb_friction at stage1_motor is known to ± 47 % only" in told["why"]
    assert told["signal_generator"]["joint"] == "stage1"
    assert told["expected_discrimination"] > 0.9
    # The error that is told is what a recording of that experiment gives.
    name = "stage1_motor.coulomb_friction.torque"
    found = sharpen(fit, name, size, record, result.scales)
    assert found.signal_generator == told["signal_generator"]
    # And whoever runs it reads before how far the motor will go.
    made = simulated_experiment(fit, found.signal_generator, record, result.scales)
    low, high = found.travel
    assert (low, high) == (made.measured[:, 0].min(), made.measured[:, 0].max())
    assert told["why"].endswith(f"the motor stays between {low:.3g} and {high:.3g} rad")


def test_a_name_that_nobody_is_sure_of_says_what_to_record(stage):
    record, *_ = stage
    result = result_of(stage)
    doubted = replace(result, choices=(replace(result.choices[0], unsure="half a cycle was seen"),))
    told = next_experiment(doubted, verdict_of(result), [record])["why"]
    assert told.startswith("coulomb_friction at stage1_motor is not sure, and no experiment is known")
    assert "(half a cycle was seen): record another motion, in both directions" in told


@pytest.mark.parametrize(("model", "table"), [(STAGE, SFJ_TABLE), (AXIS, OMNI_TABLE)])
def test_the_file_for_acquire_says_that_it_drives_the_hardware(model, table):
    text = acquire_file(model, {"why": "w", "signal_generator": {"joint": model.joint}})
    assert f"MOVES THE ROBOT: it starts {table.node_name}" in text and "`device: emulated`" in text
    content = yaml.safe_load(text)
    assert content["scenario"]["ros__parameters"]["nodes"] == [table.node_name, "acquisition"]
    assert table.node_name not in content and table.defaults()["device"] == "hardware"


def test_a_disturbance_without_bounds_is_said_and_is_no_number(stage):
    record, plain, _ = stage
    result = result_of(stage)
    usual = disturbance(result, plain, [record])
    assert all(0.0 < v < 10.0 for v in usual.values())
    assert overflows({"baseline": usual}) is None
    # The observer of an arm that nobody reads, which thinks it free although a spring holds it.
    held = STAGE.with_effects(Effect("spring_to_ground", "stage1_arm", {"stiffness": 200.0}))
    free = NoiseModel(1e-4, 1e-2, 1e-4, 1e-4, 0.5, 0.5, (*pack(held).linear[:5], 0.0, 0.0))
    away = disturbance(
        result, replace(plain, model=held, noise=free), [recorded(held, seconds=200.0, dt=0.01)]
    )
    assert None in away.values()
    told = overflows({"baseline": usual, "augmented": away})
    assert "overflows" in told
    assert "augmented at stage1" in told
