"""A plant that is stepped is the same model as one that is simulated at once."""

import numpy as np
import pytest
from plants import flexible, rigid

from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sim.effects.torque_map_file import torque_map
from haptic_teleop_sim.kernel import simulate
from haptic_teleop_sim.model import Effect
from haptic_teleop_sim.plant import Plant
from haptic_teleop_sim.plant_bank import PlantBank

DT = 2e-3
N = 800
T = DT * np.arange(N)
CURRENT = 0.3 * np.sin(4.0 * T) + 0.1 * np.sign(np.sin(9.0 * T))
PUSH = 0.1 * np.cos(5.0 * T)
OTHER = np.sin(3.0 * T)


def stepped(model, start=None):
    """States (n, nx) and readings (n, 2) at the samples."""
    plant = Plant(model, DT, start)
    states, readings = np.empty((N, len(plant.state))), np.empty((N, 2))
    for k in range(N):
        states[k] = plant.state
        readings[k] = plant.readings()
        plant.step(CURRENT[k], PUSH[k], OTHER[k])
    assert plant.time == pytest.approx(N * DT)
    assert plant.finite
    return states, readings


def typical(name):
    """Values that let the effect be seen but not dominate."""
    return {
        p.name: min(max(0.5 * p.typical if p.default is None else p.default, p.minimum), p.maximum)
        for p in EFFECTS[name].parameters
    }


CURVE = {"variable": "velocity", "knots": [-1.0, 0.0, 2.0], "torque": [0.3, 0.0, -0.4]}


@pytest.mark.parametrize("name", EFFECTS)
def test_stepping_and_simulating_give_the_same_for_every_effect(name):
    for place in EFFECTS[name].where:
        table = torque_map(CURVE) if EFFECTS[name].tabulated else None
        model = flexible().with_effects(Effect(name, f"stage1_{place}", typical(name), table))
        states, readings = stepped(model)
        whole = simulate(model, CURRENT, DT, external_torque=PUSH, exogenous=OTHER)
        if (name, place) == ("channel_skew", "actuator"):
            # Only the record's stamps are off: the machine itself is the plain one.
            whole = simulate(flexible(), CURRENT, DT, external_torque=PUSH, exogenous=OTHER)
        np.testing.assert_allclose(states, whole.states, rtol=1e-12, atol=1e-14)
        both = np.column_stack([whole.motor_position, whole.arm_position])
        # A late encoder is interpolated linearly between samples here, by splines there.
        late = EFFECTS[name].kind == "skew" and place != "actuator"
        np.testing.assert_allclose(readings[20:], both[20:], atol=2e-4 if late else 1e-14)


def test_a_rigid_body_is_pushed_directly():
    states, _ = stepped(rigid(inertia=0.2, damping=0.3))
    whole = simulate(rigid(inertia=0.2, damping=0.3), CURRENT, DT, external_torque=PUSH)
    np.testing.assert_allclose(states, whole.states, rtol=1e-12, atol=1e-14)


def test_a_plant_starts_where_it_is_put_and_again_after_a_reset():
    model = flexible(("input_delay", "actuator", {"delay": 0.01}))
    start = np.array([0.1, 0.2, 0.3, 0.4])
    first, _ = stepped(model, start)
    plant = Plant(model, DT, start)
    for k in range(50):
        plant.step(CURRENT[k])
    plant.reset(start)
    assert plant.time == 0.0
    for k in range(N):
        np.testing.assert_array_equal(plant.state, first[k])
        plant.step(CURRENT[k], PUSH[k], OTHER[k])


def test_a_bank_is_its_plants_side_by_side():
    """Different structures, effects and delays share one clock and nothing else."""
    models = [
        flexible(
            ("coulomb_friction", "motor", {"torque": 0.3}), ("input_delay", "actuator", {"delay": 0.007})
        ),
        flexible(
            ("extra_flexible_mode", "arm", {"frequency": 4.0, "inertia": 0.05}),
            ("sensor_delay", "arm_encoder", {"delay": 0.011}),
            ("encoder_scale", "motor_encoder", {"scale": 1.1}),
            ("actuator_lag", "actuator", {"time_constant": 0.02}),
        ),
        rigid(("gravity", {"torque": 0.5}), ("gain_error@actuator", {"gain": 1.3})),
    ]
    bank = PlantBank(models, DT)
    plants = [Plant(model, DT) for model in models]
    for k in range(300):
        readings = bank.readings()
        for i, plant in enumerate(plants):
            np.testing.assert_array_equal(bank.state(i), plant.state)
            assert tuple(readings[i]) == plant.readings()
            plant.step(CURRENT[k], PUSH[k], OTHER[k])
        bank.step(np.full(3, CURRENT[k]), np.full(3, PUSH[k]), np.full(3, OTHER[k]))


@pytest.mark.parametrize("dt", [0.0, -1e-3, float("nan"), float("inf")])
def test_a_sample_time_must_be_a_positive_number(dt):
    with pytest.raises(ValueError, match="sample time"):
        Plant(flexible(), dt)


def test_a_plant_that_leaves_the_finite_numbers_says_so():
    plant = Plant(flexible(), DT)
    plant.step(float("nan"))
    assert not plant.finite
