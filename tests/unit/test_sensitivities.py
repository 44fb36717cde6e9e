"""Derivatives of the prediction: exact against central differences, for every effect at every place."""

import numpy as np
import pytest

from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sim.kernel import INITIAL, pack, predict, simulate
from haptic_teleop_sim.kernel.build import kernel
from haptic_teleop_sim.model import Effect, Model

DT = 2e-3
N = 3000
START = np.array([0.01, 0.02, 0.1, 0.2])

FLEXIBLE = Model(
    "sfj", "stage1", "flexible_joint",
    {"torque_constant": 8.925, "stiffness": 3.971, "motor_inertia": 0.0635, "motor_damping": 2.6,
     "arm_inertia": 0.17, "arm_damping": 0.02},
)  # fmt: skip
RIGID = Model(
    "generic", "j", "rigid_body", {"torque_constant": 8.925, "motor_inertia": 0.2, "motor_damping": 1.3}
)

# Where the derivative is large, and smooth enough that a difference over 1e-5 of the value can be compared.
VALUES = {
    "coulomb_friction": {"torque": 0.3, "smoothing": 0.02},
    "stribeck_friction": {"coulomb": 0.05, "breakaway": 0.1, "velocity": 0.1, "smoothing": 0.03},
    "asymmetric_friction": {"positive": 0.1, "negative": 0.2, "smoothing": 0.03},
    "presliding_friction": {"torque": 0.1, "stiffness": 5.0},
    "quadratic_drag": {"coefficient": 0.1},
    "position_dependent_friction": {
        "torque": 0.1, "amplitude": 0.05, "order": 3.0, "phase": 0.3, "smoothing": 0.03,
    },
    "friction_drift": {"change": 0.3, "time_constant": 3.0},
    "load_dependent_friction": {"coefficient": 0.1, "smoothing": 0.03},
    "gravity": {"torque": 0.5, "phase": 0.2},
    "spring_to_ground": {"stiffness": 0.2, "rest": 0.1},
    "constant_torque": {"torque": 0.1},
    "torque_ripple": {"amplitude": 0.1, "order": 5.0, "phase": 0.2},
    "hard_stop": {"angle": 0.1, "stiffness": 20.0, "dissipation": 0.2},
    "backlash": {"width": 0.02},
    "hardening_spring": {"cubic": 10.0},
    "hysteresis": {"torque": 0.1, "displacement": 0.05},
    "joint_damping": {"coefficient": 0.1},
    "inertial_coupling": {"coefficient": 0.02},
    "payload_change": {"time": 3.0, "inertia": 0.05},
    "extra_flexible_mode": {"frequency": 4.0, "inertia": 0.05, "damping_ratio": 0.05},
    "angle_dependent_inertia": {"amplitude": 0.4, "order": 3.0, "phase": 0.3},
    "torque_speed_limit": {"limit": 3.0, "slope": 0.7},
    "gain_error": {"gain": 1.1},
    "gain_drift": {"change": 0.1, "time_constant": 3.0},
    "torque_saturation": {"limit": 1.5},
    "dead_zone": {"width": 0.1},
    "actuator_lag": {"time_constant": 0.03},
    "input_delay": {"delay": 0.0153},
    "encoder_scale": {"scale": 1.05},
    "encoder_eccentricity": {"amplitude": 0.01, "order": 2.0, "phase": 0.3},
    "sensor_delay": {"delay": 0.0101},
    "channel_skew": {"delay": 0.0041},
}  # fmt: skip


def cases():
    return [*_cases()]


def _cases():
    for name, entry in EFFECTS.items():
        if entry.tabulated:  # nothing of it is estimated: see test_torque_map.py
            continue
        for place in entry.where:
            yield pytest.param(FLEXIBLE, name, place, id=f"{name}-{place}")
        if entry.rigid_body:
            for place in entry.where:
                if place in ("motor", "actuator", "motor_encoder"):
                    yield pytest.param(RIGID, name, place, id=f"{name}-{place}-rigid")


def signals():
    t = DT * np.arange(N)
    return 0.2 * np.sin(np.pi * t) + 0.05 * np.sin(7 * t), np.sin(3 * t)


def record(model):
    """What the encoders of the plain model show, with a smooth deviation that the observer has to work on."""
    run = simulate(model, signals()[0], DT)
    t = DT * np.arange(N)
    wander = 0.003 * np.column_stack([np.sin(8.0 * t) + np.sin(3.1 * t), np.cos(5.3 * t) + np.sin(2.2 * t)])
    return np.column_stack([run.motor_position, run.arm_position]) + wander


def observer(states):
    gain = np.zeros((states, 2))
    gain[0, 0], gain[1, 1], gain[2, 0], gain[3, 1], gain[-2, 0], gain[-1, 1] = 0.1, 0.1, 2.0, 2.0, 0.5, 0.5
    return gain


def prediction(model, measured, start, free=(), gain=True):
    packed = pack(model)
    input_, exogenous = signals()
    correction = observer(packed.states) if gain else None
    options = {"gain": correction, "decay": (0.99, 0.98), "exogenous": exogenous, "initial_state": start}
    return predict(packed, input_, measured, DT, free, **options)


def slope(model, measured, start, name, step):
    """Central difference of the innovation by one parameter or one number of the initial state."""

    def at(shift):
        if name in INITIAL:
            return prediction(model, measured, start + shift * np.eye(4)[INITIAL.index(name)]).innovation
        changed = model.with_values({name: model.parameter_values()[name] + shift})
        return prediction(changed, measured, start).innovation

    return (at(step) - at(-step)) / (2.0 * step)


@pytest.mark.parametrize(("plain", "effect", "place"), cases())
def test_sensitivities_equal_central_differences(plain, effect, place):
    values = VALUES.get(effect) or {p.name: p.typical for p in EFFECTS[effect].parameters}
    extra = [Effect(effect, plain.location(place), values)]
    if EFFECTS[effect].kind == "friction_factor":
        extra.append(Effect("coulomb_friction", plain.location(place), VALUES["coulomb_friction"]))
    model = plain.with_effects(*extra)
    measured = record(plain)
    free = model.free_parameters() + (INITIAL if not plain.rigid else INITIAL[::2])
    start = START if not plain.rigid else START * [1, 0, 1, 0]
    exact = prediction(model, measured, start, free)
    for column, name in enumerate(free):
        value = model.parameter_values().get(name, 1.0)
        step = 1e-6 if name in INITIAL else 1e-5 * max(abs(value), 1e-2)
        difference = slope(model, measured, start, name, step)
        error = np.linalg.norm(difference - exact.d_innovation[:, :, column])
        assert error <= 2e-3 * np.linalg.norm(difference), (name, error / np.linalg.norm(difference))


@pytest.mark.parametrize("samples", [0.3, 5.5, 2.9, -0.25, -1.6])
@pytest.mark.parametrize("place", ["motor_encoder", "arm_encoder"])
def test_readings_from_between_two_samples_have_exact_sensitivities(monkeypatch, place, samples):
    monkeypatch.setitem(VALUES, "channel_skew", {"delay": samples * DT})
    test_sensitivities_equal_central_differences(FLEXIBLE, "channel_skew", place)


def test_the_contact_of_a_sticking_friction_has_exact_sensitivities(monkeypatch):
    contact = {"torque": 0.3, "contact_angle": 0.004}
    monkeypatch.setitem(VALUES, "coulomb_friction", contact)
    test_sensitivities_equal_central_differences(FLEXIBLE, "coulomb_friction", "motor")


MEMORIES = [("presliding_friction", "stage1_arm"), ("hysteresis", "stage1_joint")]


@pytest.mark.parametrize("memories", range(3))  # more go the general way whatever else they do
def test_all_ways_through_a_step_have_the_same_derivatives(memories):
    """Steps for up to two memories and a number of columns that compilers know, for any number of both, and
    by one matrix: each has those of the last, which the differences above judge."""
    effects = [Effect(name, place, VALUES[name]) for name, place in MEMORIES[:memories]]
    model = FLEXIBLE.with_effects(*effects)
    measured, free = record(FLEXIBLE), model.free_parameters() + INITIAL

    def derivatives(model, columns):
        held = (np.zeros((pack(model).states, 2, columns)), np.zeros((2, columns)))
        gain = observer(pack(model).states)
        options = {"gain": gain, "decay": (0.99, 0.98), "gain_slopes": held, "initial_state": START}
        return predict(pack(model), signals()[0], measured, DT, free, **options).d_innovation

    few, many = derivatives(model, len(free)), derivatives(model, kernel().PITCH + 1)
    # An effect with own states that does nothing, and so takes the way for them.
    idle = Effect("extra_flexible_mode", "stage1_arm", {**VALUES["extra_flexible_mode"], "inertia": 1e-12})
    general = derivatives(model.with_effects(idle), len(free))
    scale = np.abs(few).max()
    assert scale > 0.1 and pack(model).states == 6 + memories
    np.testing.assert_allclose(many[:, :, : len(free)], few, rtol=0, atol=1e-10 * scale)
    np.testing.assert_allclose(many[:, :, len(free) :], 0.0)
    np.testing.assert_allclose(general, few, rtol=0, atol=1e-6 * scale)


def test_prediction_with_and_without_derivatives_is_the_same():
    model = FLEXIBLE.with_effects(
        Effect("stribeck_friction", "stage1_motor", VALUES["stribeck_friction"]),
        Effect("hysteresis", "stage1_joint", VALUES["hysteresis"]),
    )
    measured = record(FLEXIBLE)
    plain = prediction(model, measured, START)
    full = prediction(model, measured, START, model.free_parameters())
    np.testing.assert_allclose(full.innovation, plain.innovation, rtol=0, atol=1e-12)
    np.testing.assert_allclose(full.states, plain.states, rtol=0, atol=1e-12)


def test_prediction_without_correction_is_the_simulation():
    model = FLEXIBLE.with_effects(Effect("coulomb_friction", "stage1_motor", VALUES["coulomb_friction"]))
    input_ = signals()[0]
    run = simulate(model, input_, DT, START)
    measured = np.zeros((N, 2))
    packed = pack(model)
    got = predict(packed, input_, measured, DT, initial_state=START)
    np.testing.assert_array_equal(-got.innovation, np.column_stack([run.motor_position, run.arm_position]))


def test_a_missing_reading_corrects_nothing():
    measured = record(FLEXIBLE)
    measured[100:200] = np.nan
    model = FLEXIBLE
    got = prediction(model, measured, START, ("stiffness",))
    assert np.all(got.innovation[100:200] == 0.0)
    assert np.all(got.d_innovation[100:200] == 0.0)
    packed = pack(model)
    bridged = simulate(
        packed, signals()[0][100:200], DT, np.concatenate([got.states[100, :4], got.states[100, 4:]])
    ).states
    # Without readings the states go on by themselves, but for the disturbances, which decay.
    np.testing.assert_allclose(got.states[101, :4], bridged[1, :4], rtol=0, atol=1e-12)


def test_derivatives_stay_finite_far_beyond_the_friction_curve():
    """At hundreds of times the Stribeck velocity, where cosh would overflow."""
    steep = {"coulomb": 0.05, "breakaway": 0.1, "velocity": 1e-4, "smoothing": 0.01}
    model = FLEXIBLE.with_effects(Effect("stribeck_friction", "stage1_motor", steep))
    got = prediction(
        model, record(FLEXIBLE), np.array([0.0, 0.0, 2.0, 0.0]), model.free_parameters(), gain=False
    )
    assert np.all(np.isfinite(got.d_innovation))
