"""A torque that changes within a sample: delays and lags against the matrix exponential on a fine grid."""

import numpy as np
import pytest
from scipy.linalg import expm

from haptic_teleop_sim.kernel import acting_torque, pack, predict, simulate
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sim.plant import Plant

DT, FINE, SAMPLES = 0.002, 200, 400
P = {
    "torque_constant": 1.3,
    "stiffness": 4.0,
    "motor_inertia": 0.07,
    "motor_damping": 2.5,
    "arm_inertia": 0.16,
    "arm_damping": 0.02,
}
MODEL = Model("sfj", "stage1", "flexible_joint", P)


def command():
    return np.random.default_rng(11).uniform(-1.0, 1.0, SAMPLES)


def with_effect(name, **parameters):
    return MODEL.with_effects(Effect(name, "stage1_actuator", parameters))


def exact(current):
    """Motor and arm angle at the samples (n, 2) for a current on the fine grid, held over each step."""
    a, b = np.zeros((4, 4)), np.zeros((4, 1))
    a[0, 2] = a[1, 3] = 1.0
    ks, jm, ja = P["stiffness"], P["motor_inertia"], P["arm_inertia"]
    a[2] = [-ks / jm, ks / jm, -P["motor_damping"] / jm, 0.0]
    a[3] = [ks / ja, -ks / ja, 0.0, -P["arm_damping"] / ja]
    b[2] = P["torque_constant"] / jm
    both = expm(np.block([[a, b], [np.zeros((1, 5))]]) * DT / FINE)
    state, out = np.zeros(4), []
    for i, u in enumerate(current):
        if i % FINE == 0:
            out.append(state[:2])
        state = both[:4, :4] @ state + both[:4, 4] * u
    return np.array(out)


def delayed(u, delay):
    steps = round(delay / DT * FINE)
    fine = np.repeat(u, FINE)
    return np.concatenate([np.zeros(steps), fine[: len(fine) - steps]]) if steps else fine


def lagged(u, tau):
    out, value, keep = [], 0.0, np.exp(-DT / FINE / tau)
    for wanted in np.repeat(u, FINE):
        # Mean over a fine step of the exponential.
        mean = wanted + (value - wanted) * tau / (DT / FINE) * (1.0 - keep)
        value = wanted + (value - wanted) * keep
        out.append(mean)
    return np.array(out)


CASES = [
    ("input_delay", {"delay": 0.0007}, lambda u: delayed(u, 0.0007)),
    ("input_delay", {"delay": 0.0053}, lambda u: delayed(u, 0.0053)),
    ("channel_skew", {"delay": -0.0013}, lambda u: delayed(u, 0.0013)),
    ("actuator_lag", {"time_constant": 0.0009}, lambda u: lagged(u, 0.0009)),
    ("actuator_lag", {"time_constant": 0.006}, lambda u: lagged(u, 0.006)),
]


@pytest.mark.parametrize(("effect", "parameters", "acting"), CASES)
def test_the_motor_goes_where_a_torque_that_changes_within_samples_drives_it(effect, parameters, acting):
    u = command()
    if effect == "channel_skew":
        u[:5] = 0.0  # before the recording the first command is taken to have acted
    model = with_effect(effect, **parameters)
    path, truth = simulate(model, u, DT), exact(acting(u))
    by_mean = simulate(MODEL, acting_torque(pack(model), u, DT) / P["torque_constant"], DT)
    error, of_mean = (np.abs(np.diff(one.motor_position - truth[:, 0])) for one in (path, by_mean))
    # What is left is damping within the sample.
    assert np.max(error) < 0.08 * np.max(of_mean)
    assert np.max(error) < 1e-6
    assert np.max(np.abs(path.arm_position - truth[:, 1])) < 2e-6


def test_a_gain_behind_a_delay_takes_the_moment_with_it():
    u = command()
    both = with_effect("input_delay", delay=0.0007).with_effects(
        Effect("gain_error", "stage1_actuator", {"gain": 0.8})
    )
    path = simulate(both, u, DT)
    assert path.motor_position == pytest.approx(exact(0.8 * delayed(u, 0.0007))[:, 0], abs=2e-6)


@pytest.mark.parametrize(("effect", "parameters", "acting"), CASES)
def test_derivatives_of_what_changes_within_a_sample_are_those_of_the_simulation(effect, parameters, acting):
    model, u = with_effect(effect, **parameters), command()
    free = model.free_parameters()
    found = predict(pack(model), u, np.zeros((SAMPLES, 2)), DT, free).d_innovation
    values = model.parameter_values()
    for i, name in enumerate(free):
        step = 1e-5 * abs(values[name])
        up, down = (
            simulate(model.with_values({name: values[name] + way * step}), u, DT) for way in (1.0, -1.0)
        )
        slope = (up.motor_position - down.motor_position) / (2.0 * step)
        assert found[:, 0, i] == pytest.approx(-slope, rel=2e-3, abs=2e-3 * np.max(np.abs(slope))), name


@pytest.mark.parametrize(("effect", "parameters", "acting"), CASES[:2] + CASES[3:])
def test_a_plant_that_is_stepped_goes_the_same_way(effect, parameters, acting):
    model, u = with_effect(effect, **parameters), command()
    path, plant = simulate(model, u, DT), Plant(model, DT)
    for k in range(SAMPLES):
        assert plant.state[:2] == pytest.approx(path.states[k, :2], abs=1e-12)
        plant.step(u[k])
