"""The fit in percent, its windows, and the estimated initial state, against joints simulated elsewhere."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from joint_recordings import DT, TRUTH, excitation, joint_recording, response

from haptic_teleop_control.errors import ConfigurationError, ModelError
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.recordings.dataset import load_dataset
from haptic_teleop_sysid.recordings.velocity_series import velocity_series
from haptic_teleop_sysid.simulation.fit import choose_windows, fit_percent, simulated_fit
from haptic_teleop_sysid.simulation.parameter_fit import fit_output_error
from haptic_teleop_sysid.simulation.windows import closed_loop, cut

MODEL = Model("sfj", "stage1", "flexible_joint", TRUTH)
N = 5000
CURRENT = excitation(N)


def dataset_of(initial=(0.0, 0.0, 0.0, 0.0), current=CURRENT, parameters=TRUTH, **changes):
    return load_dataset(
        joint_recording(current, response(current, parameters, initial), **changes), MODEL, "made"
    )


@given(st.lists(st.floats(-10, 10), min_size=3, max_size=30), st.floats(-5, 5), st.floats(0.1, 10))
def test_the_fit_is_the_contracts_formula_and_knows_neither_offset_nor_unit(values, offset, unit):
    y = np.array(values)
    if np.ptp(y) < 1e-3:
        return
    simulated = np.roll(y, 1)
    mean = math.fsum(values) / len(values)
    above = math.sqrt(math.fsum((a - b) ** 2 for a, b in zip(y, simulated, strict=True)))
    below = math.sqrt(math.fsum((a - mean) ** 2 for a in y))
    expected = 100 * (1 - above / below)
    assert fit_percent(y, simulated) == pytest.approx(expected, abs=1e-6)
    assert fit_percent(unit * (y + offset), unit * (simulated + offset)) == pytest.approx(expected, abs=1e-6)


def test_the_limits_of_the_fit():
    y = np.array([1.0, 2.0, 4.0])
    assert fit_percent(y, y) == 100.0
    assert fit_percent(y, np.full(3, y.mean())) == pytest.approx(0.0)
    assert fit_percent(y, np.array([1.0, np.inf, 2.0])) == -math.inf
    assert math.isnan(fit_percent(np.ones(3), np.ones(3)))


def test_the_true_model_fits_perfectly_from_an_unknown_initial_state():
    initial = (0.3, 0.1, -0.2, 0.5)
    dataset = dataset_of(initial)
    fit = simulated_fit(MODEL, dataset, cut(dataset, None, ""))
    assert fit.percent["stage1_motor.position"] > 99.99
    assert fit.percent["stage1_arm.position"] > 99.99
    assert np.allclose(fit.initial_states[0], initial, atol=1e-4)
    assert fit.rms["stage1_arm.position"] < 1e-6


def test_velocities_are_compared_as_the_recordings_filter_shows_them():
    dataset = dataset_of()
    percent = simulated_fit(MODEL, dataset, cut(dataset, None, "")).percent
    # The filter's delay of 7 ms alone would cost several percent.
    assert percent["stage1_motor.velocity"] > 99.9
    unaware = simulated_fit(MODEL, replace(dataset, velocity_filter=None), cut(dataset, None, "")).percent
    assert unaware["stage1_motor.velocity"] < 97.0


def test_filtered_velocities_follow_the_filters_differential_equation():
    # A steady motion shows its speed from the first sample, a step of speed the filter's step response.
    dt, speed, cutoff, damping = 1e-4, 0.7, 40.0, 0.9
    t = dt * np.arange(2000)
    assert velocity_series(0.2 + speed * t, dt, cutoff, damping, speed) == pytest.approx(speed)
    wc, wd = 2 * np.pi * cutoff, 2 * np.pi * cutoff * np.sqrt(1 - damping**2)
    decay = np.exp(-damping * wc * t)
    response_ = 1 - decay * (np.cos(wd * t) + damping * wc / wd * np.sin(wd * t))
    assert velocity_series(speed * t, dt, cutoff, damping) == pytest.approx(speed * response_, abs=1e-3)


def test_a_wrong_model_is_given_its_best_initial_state():
    wrong = {**TRUTH, "motor_damping": 3.2}
    dataset = dataset_of()
    # The joint is linear, so its best initial state is a linear least-squares problem over four free
    # responses, in angles and filtered velocities, each by its spread.
    angles = np.column_stack([dataset.motor_position, dataset.arm_position])
    spread = [angles.std(axis=0), np.array([dataset.motor_velocity.std(), dataset.arm_velocity.std()])]

    def weighted(part):
        rates = np.column_stack([velocity_series(part[:, c].copy(), DT, 40.0, 0.9) for c in (0, 1)])
        return np.concatenate([(part / spread[0]).ravel(), (rates / spread[1]).ravel()])

    columns = np.column_stack([weighted(response(np.zeros(N), wrong, one)[:, :2]) for one in np.eye(4)])
    forced = response(CURRENT, wrong)[:, :2]
    best = np.linalg.lstsq(columns, weighted(angles - forced), rcond=None)[0]
    simulated = response(CURRENT, wrong, best)
    fit = simulated_fit(replace(MODEL, parameters=wrong), dataset, cut(dataset, None, ""))
    assert np.allclose(fit.initial_states[0], best, atol=1e-3)
    for signal, column in (("stage1_motor.position", 0), ("stage1_arm.position", 1)):
        expected = fit_percent(angles[:, column], simulated[:, column])
        assert fit.percent[signal] == pytest.approx(expected, abs=0.01)
        assert expected < 90.0


def test_what_pushes_the_joint_slowly_away_is_not_made_up_for_by_a_speed_it_never_had():
    # A free integrator drifts under a slow torque; an initial speed of the motor, gone after 30 ms, shifts
    # the angle just so.
    push = 0.005 * np.sin(2 * np.pi * 0.05 * DT * np.arange(N))
    dataset = dataset_of(current=CURRENT + push)
    dataset = replace(dataset, input=dataset.input - push)
    fit = simulated_fit(MODEL, dataset, cut(dataset, None, ""))
    assert np.abs(fit.initial_states[0, 2:]).max() < 0.5 * dataset.motor_velocity.std()
    assert fit.percent["stage1_motor.velocity"] > 95.0


@pytest.mark.parametrize("late", [-0.7, -0.3, 0.6, 1.6])
def test_an_encoder_that_is_stamped_early_or_late_changes_nothing_of_where_a_window_begins(late):
    # Its first or last reading in a window belongs to a moment outside; the step from no error to the next
    # one is no speed.
    fine = response(np.repeat(CURRENT, 10), dt=DT / 10)
    states = fine[::10]
    moved = np.clip(10 * np.arange(N) - round(10 * late), 0, 10 * N - 1)
    recording = joint_recording(CURRENT, np.column_stack([fine[moved, 0], states[:, 1:]]))
    # A machine that is a little off, so that errors are not zero where a window begins.
    wrong = {**TRUTH, "motor_inertia": 1.1 * TRUTH["motor_inertia"], "motor_damping": 2.7}
    model = Model("sfj", "stage1", "flexible_joint", wrong)
    dataset = load_dataset(recording, model, "moved")
    plain = load_dataset(joint_recording(CURRENT, states), model, "made")
    skewed = model.with_effects(Effect("channel_skew", "stage1_motor_encoder", {"delay": late * DT}))
    found = simulated_fit(skewed, dataset, cut(dataset, 2.0, ""))
    expected = simulated_fit(model, plain, cut(plain, 2.0, ""))
    for name, percent in expected.percent.items():
        assert found.percent[name] == pytest.approx(percent, abs=0.5), name


def test_windows_are_consecutive_equal_and_cover_everything():
    dataset = dataset_of()
    windows = cut(dataset, 3.0, "")
    assert [a for a, _ in windows.spans[1:]] == [b for _, b in windows.spans[:-1]]
    assert (windows.spans[0][0], windows.spans[-1][1]) == (0, N)
    lengths = {b - a for a, b in windows.spans}
    assert max(lengths) - min(lengths) <= 1
    assert windows.seconds == pytest.approx(10.0 / 3.0, abs=DT)


def test_no_window_holds_an_invalid_sample():
    dataset = dataset_of()
    valid = np.ones(N, dtype=bool)
    valid[2000:2100] = False
    spans = cut(replace(dataset, valid=valid), None, "").spans
    assert spans == ((0, 2000), (2100, 5000))
    fit = simulated_fit(MODEL, replace(dataset, valid=valid), cut(replace(dataset, valid=valid), None, ""))
    assert np.isnan(fit.simulated["stage1_arm.position"][2000:2100]).all()
    assert fit.percent["stage1_arm.position"] > 99.9


def test_a_window_too_short_for_anything_is_refused():
    with pytest.raises(ConfigurationError, match=r"made.*--window"):
        choose_windows(MODEL, dataset_of(), 0.01)
    with pytest.raises(ConfigurationError, match="2 ms apart: is the time in another unit"):
        cut(dataset_of(), 0.01, "")


def test_an_actuators_memory_lasts_over_window_borders():
    delayed = np.concatenate([np.zeros(100), CURRENT[:-100]])
    states = response(delayed)
    dataset = load_dataset(joint_recording(CURRENT, states), MODEL, "made")
    model = MODEL.with_effects(Effect("input_delay", "stage1_actuator", {"delay": 100 * DT}))
    fit = simulated_fit(model, dataset, cut(dataset, 1.0, ""))
    assert len(fit.windows.spans) == 10
    assert fit.percent["stage1_motor.position"] > 99.9


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("force loop, multisine", True),
        ("position loop", True),
        ("closed-loop", True),
        ("scenario1", True),
        ("open loop, chirp", False),
        ("axis 1 run A", None),
        ("", None),
    ],
)
def test_closed_loop_is_read_from_what_the_recording_says(kind, expected):
    assert closed_loop(dataset_of(kind=kind)) is expected


def test_the_rule_for_windows():
    model = MODEL
    short = choose_windows(model, dataset_of(current=CURRENT[:2500]))
    assert short.seconds is None
    opened = choose_windows(model, dataset_of())
    assert opened.seconds is None
    closed = choose_windows(model, dataset_of(kind="force loop"))
    assert closed.seconds == pytest.approx(4.0, rel=0.3)
    # An offset of 20 mA, unknown to the model, lets the free integrator run away.
    drifting = load_dataset(joint_recording(CURRENT, response(CURRENT + 0.02)), MODEL, "made")
    assert choose_windows(model, drifting).seconds is not None
    assert "drift" in choose_windows(model, drifting).why
    assert choose_windows(model, drifting, "whole").seconds is None
    assert choose_windows(model, opened and dataset_of(), 2.0).seconds == pytest.approx(2.0)


def test_an_unstable_model_gets_a_bad_fit_and_no_exception():
    unstable = replace(MODEL, parameters={**TRUTH, "motor_damping": -30.0})
    dataset = dataset_of()
    fit = simulated_fit(unstable, dataset, cut(dataset, None, ""))
    assert not fit.percent["stage1_motor.position"] > 0.0


def test_least_squares_finds_the_true_parameters():
    guess = {**TRUTH, "motor_inertia": 0.08, "motor_damping": 2.0, "arm_inertia": 0.14, "arm_damping": 0.05}
    model = replace(MODEL, parameters=guess, fixed=("stiffness", "torque_constant"))
    dataset = dataset_of()
    found = fit_output_error(model, [(dataset, cut(dataset, 2.5, ""))])
    assert found.converged
    for name in ("motor_inertia", "motor_damping", "arm_inertia", "arm_damping"):
        assert found.model.parameters[name] == pytest.approx(TRUTH[name], rel=0.01, abs=1e-3)
    assert found.model.parameters["stiffness"] == TRUTH["stiffness"]


def test_standard_errors_are_those_of_the_linearised_problem_under_white_noise():
    names = ("motor_damping", "arm_inertia")
    sigma, random = np.array([2e-3, 3e-3]), np.random.default_rng(3)
    states = response(CURRENT)
    model = replace(MODEL, fixed=tuple(n for n in TRUTH if n not in names))
    stated = []
    for _ in range(6):
        noisy = states.copy()
        noisy[:, :2] += sigma * random.standard_normal((N, 2))
        dataset = load_dataset(joint_recording(CURRENT, noisy), MODEL, "made")
        dataset = replace(dataset, motor_position=noisy[:, 0], arm_position=noisy[:, 1])
        found = fit_output_error(model, [(dataset, cut(dataset, None, ""))])
        stated.append([found.std[n] for n in names])
        assert found.model.parameters["arm_inertia"] == pytest.approx(TRUTH["arm_inertia"], rel=5e-3)
    # Columns by differences of the test's own integrator; each angle weighs by its spread, as in the fit.
    spread = states[:, :2].std(axis=0)
    columns = []
    for name in names:
        step = 1e-4 * TRUTH[name]
        up, down = (response(CURRENT, {**TRUTH, name: TRUTH[name] + s * step})[:, :2] for s in (1, -1))
        columns.append(((up - down) / (2 * step) / spread).ravel())
    columns += [(response(np.zeros(N), TRUTH, x)[:, :2] / spread).ravel() for x in np.eye(4)]
    inverse = np.linalg.pinv(np.column_stack(columns))
    expected = np.sqrt(np.sum((inverse * np.tile(sigma / spread, N)) ** 2, axis=1))[: len(names)]
    assert np.allclose(np.mean(stated, axis=0), expected, rtol=0.25)


def test_with_everything_fixed_there_is_nothing_to_fit():
    dataset = dataset_of()
    with pytest.raises(ModelError, match="fixed"):
        fit_output_error(replace(MODEL, fixed=tuple(TRUTH)), [(dataset, cut(dataset, None, ""))])


def test_a_parameter_that_flees_is_named():
    # Nothing that the motor does follows from this current: the best inertia is one that never moves.
    unrelated = np.random.default_rng(5).normal(0.0, 0.3, N)
    dataset = load_dataset(joint_recording(unrelated, response(CURRENT)), MODEL, "made")
    model = Model(
        "sfj", "stage1", "rigid_body", {"torque_constant": 8.925, "motor_inertia": 0.06, "motor_damping": 0.0}
    )
    found = fit_output_error(replace(model, fixed=("torque_constant",)), [(dataset, cut(dataset, None, ""))])
    assert found.fled == ("motor_inertia",)
