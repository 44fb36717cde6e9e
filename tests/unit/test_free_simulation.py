"""Where free simulations over many windows begin, against a search that knows nothing of their
derivatives."""

import numpy as np
import pytest
from plants import flexible, rigid
from scipy.optimize import least_squares

from haptic_teleop_sim.kernel import free_simulation, nearest_starts, pack, respond, simulate

DT, N = 1e-3, 600
SPANS = [(0, 150), (150, 390), (420, 600)]
FRICTION = ("coulomb_friction", "motor", {"torque": 0.3, "smoothing": 0.05})
DRAG = ("quadratic_drag", {"coefficient": 0.5})
TORQUE = np.repeat(np.random.default_rng(5).standard_normal(N // 20), 20)


def one_torque_constant(model):
    return pack(type(model)(**{**vars(model), "parameters": {**model.parameters, "torque_constant": 1.0}}))


def shown_from(packed, state, part):
    return simulate(packed, TORQUE[part], DT, state, t0=DT * part.start)


@pytest.mark.parametrize("model", [flexible(FRICTION), rigid(DRAG)], ids=["flexible", "rigid"])
def test_each_window_begins_where_its_errors_of_angles_and_rates_are_least(model):
    packed = one_torque_constant(model)
    motion = simulate(packed, TORQUE, DT, [0.1, -0.1, 0.5, 0.2])
    angles = np.column_stack([motion.motor_position, motion.arm_position])
    angles += 0.02 * np.random.default_rng(6).standard_normal(angles.shape)
    angles[200:230, 0] = np.nan
    if packed.rigid:
        angles[:, 1] = np.nan
    weights, rate_weights = np.array([5.0, 8.0]), np.array([0.7, 0.0])
    used = [0, 2] if packed.rigid else [0, 1, 2, 3]
    begin = np.array([[*np.nan_to_num(angles[start]), 0.0, 0.0] for start, _ in SPANS])

    def errors(free, first, part):
        state = first.copy()
        state[used] = free
        shown = shown_from(packed, state, part)
        error = np.nan_to_num(angles[part] - np.column_stack([shown.motor_position, shown.arm_position]))
        # A reading that is missing keeps the error of the last one.
        read = np.isfinite(angles[part, 0])
        held = np.maximum.accumulate(np.where(read, np.arange(len(read)), 0))
        rate = np.gradient(error[held, 0], DT)
        return np.concatenate([(weights * error).ravel(), rate_weights[0] * rate])

    found = nearest_starts(
        packed, TORQUE, angles, DT, SPANS, begin, weights=weights, rate_weights=rate_weights
    )

    read = respond(packed, TORQUE, DT, SPANS, found)
    assert np.all(np.isnan(read.motor_position[390:420])), "outside the windows there is nothing"
    for span, own, first in zip(SPANS, found, begin, strict=True):
        part = slice(*span)
        best = least_squares(
            errors, first[used], x_scale="jac", ftol=1e-12, xtol=1e-12, kwargs={"first": first, "part": part}
        )
        assert 0.5 * np.sum(errors(own[used], first, part) ** 2) <= best.cost * (1.0 + 1e-3)
        expected = shown_from(packed, own, part).motor_velocity
        np.testing.assert_allclose(read.motor_velocity[part], expected, rtol=1e-9, atol=1e-12)


def test_a_response_that_runs_away_leaves_the_search_where_it_began():
    packed = one_torque_constant(flexible(motor_damping=-1e5))
    begin = np.array([[0.1, 0.1, 0.0, 0.0]])
    angles = np.full((N, 2), 0.1)
    weights = np.array([1.0, 1.0])
    found = nearest_starts(packed, TORQUE, angles, DT, [(0, N)], begin, weights=weights, rate_weights=weights)
    np.testing.assert_array_equal(found, begin)


def test_a_pendulum_on_its_head_is_followed_although_it_falls_from_where_it_was_measured():
    inertia, weight, seconds, dt = 0.2, 2.0, 3.0, 2e-3
    packed = pack(rigid(("gravity", {"torque": weight, "phase": np.pi}), inertia=inertia, damping=0.1))
    rng = np.random.default_rng(3)
    wanted = 0.3 * np.sin(2 * np.pi * 0.7 * np.arange(0.0, seconds, dt))
    # Held upright by a law of its own; the torque that it took is replayed without the law.
    state, torque, motion = np.zeros(4), np.empty(len(wanted)), np.empty((len(wanted), 4))
    for k, aim in enumerate(wanted):
        motion[k] = state
        torque[k] = 12.0 * (aim - state[0]) - 1.5 * state[2] - weight * np.sin(aim)
        state = simulate(packed, np.full(2, torque[k]), dt, state).states[1, :4]
    growth = np.exp(np.sqrt(weight / inertia) * seconds)
    noise, spread = 0.01, np.std(motion[:, 0])
    angles = np.full((len(wanted), 2), np.nan)
    angles[:, 0] = motion[:, 0] + noise * rng.standard_normal(len(wanted))
    begin = np.array([[angles[0, 0], angles[0, 0], motion[0, 2], motion[0, 2]]])
    weights = np.array([1.0 / spread, 0.0])

    def missed(states):
        read = respond(packed, torque, dt, [(0, len(wanted))], states)
        return np.sqrt(np.mean((read.motor_position - motion[:, 0]) ** 2))

    assert growth * noise > 50.0 * spread and missed(begin) > 5.0 * spread
    found = nearest_starts(
        packed, torque, angles, dt, [(0, len(wanted))], begin, weights=weights, rate_weights=np.zeros(2)
    )
    assert missed(found) < noise


@pytest.mark.parametrize("late", [0.003, 0.0085, -0.002])
def test_a_late_encoder_shows_in_a_window_what_came_before_it_and_not_that_it_stood_still(late):
    packed = one_torque_constant(flexible(("sensor_delay", "arm_encoder", {"delay": abs(late)})))
    if late < 0.0:
        packed = one_torque_constant(flexible(("channel_skew", "arm_encoder", {"delay": late})))
    whole = simulate(packed, TORQUE, DT)
    start = int(np.argmax(np.abs(whole.arm_velocity[100:500]))) + 100
    read = respond(packed, TORQUE, DT, [(start, start + 60)], whole.states[[start], :4])
    part = slice(start, start + 60)
    error = read.arm_position[part] - whole.arm_position[part]
    # Steady before and after: what is missing is half the acceleration times the delay squared.
    bent = np.abs(np.gradient(whole.arm_velocity, DT)).max()
    assert np.abs(error).max() <= bent * late**2
    assert np.abs(error).max() < 0.1 * np.abs(whole.arm_velocity[start]) * abs(late)


def test_what_a_late_encoder_reads_of_a_motion_that_runs_away_is_no_number_and_no_error():
    late = ("sensor_delay", "arm_encoder", {"delay": 0.003})
    run = simulate(flexible(late, motor_damping=-1e5), np.ones(N), DT)
    assert not np.all(np.isfinite(run.states)) and np.all(np.isnan(run.arm_position))


def test_windows_of_a_straight_joint_begin_together_where_each_alone_does():
    packed = one_torque_constant(flexible())
    motion = simulate(packed, TORQUE, DT, [0.1, -0.1, 0.5, 0.2])
    angles = np.column_stack([motion.motor_position, motion.arm_position])
    angles += 0.02 * np.random.default_rng(6).standard_normal(angles.shape)
    angles[230:260, 1] = np.nan
    spans = [(0, 100), (100, 200), (200, 300), (300, 400), (400, 560)]
    begin = np.array([[*np.nan_to_num(angles[start]), 0.0, 0.0] for start, _ in spans])

    def found(some, first):
        return nearest_starts(
            packed,
            TORQUE,
            angles,
            DT,
            some,
            first,
            weights=np.array([5.0, 8.0]),
            rate_weights=np.array([0.7, 0.4]),
            velocity_filter=(20.0, 0.7),
        )

    alone = [found([span], first[None])[0] for span, first in zip(spans, begin, strict=True)]
    np.testing.assert_allclose(found(spans, begin), alone, rtol=1e-9, atol=1e-12)


def test_of_a_long_window_the_beginning_says_where_it_begins(monkeypatch):
    packed = one_torque_constant(flexible(FRICTION))
    motion = simulate(packed, TORQUE, DT, [0.1, -0.1, 0.5, 0.2])
    angles = np.column_stack([motion.motor_position, motion.arm_position])
    begin, weights = np.array([[0.1, -0.1, 0.0, 0.0]]), np.array([1.0, 1.0])
    monkeypatch.setattr(free_simulation, "LONGEST", 200)
    for first in (200, 100):
        read = angles.copy()
        read[first:] += 1.0
        found = nearest_starts(
            packed, TORQUE, read, DT, [(0, N)], begin, weights=weights, rate_weights=weights
        )
        assert np.allclose(found[0], [0.1, -0.1, 0.5, 0.2], atol=1e-3) == (first == 200)
