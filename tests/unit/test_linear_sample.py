"""A joint without effects goes sample by sample through one matrix: the same as by Runge-Kutta, derivatives
included, which a torque of size zero forces."""

import numpy as np
import pytest

from haptic_teleop_sim.kernel import INITIAL, pack, predict, simulate
from haptic_teleop_sim.model import Effect, Model

DT, N = 2e-3, 2000
FLEXIBLE = Model(
    "sfj", "stage1", "flexible_joint",
    {"torque_constant": 8.925, "stiffness": 3.971, "motor_inertia": 0.0635, "motor_damping": 2.6,
     "arm_inertia": 0.17, "arm_damping": 0.02},
)  # fmt: skip
STIFF = FLEXIBLE.with_values({"stiffness": 4e4})
RIGID = Model(
    "generic", "j", "rigid_body", {"torque_constant": 8.925, "motor_inertia": 0.2, "motor_damping": 1.3}
)
ACTUATOR = {
    "input_delay": {"delay": 0.0153},
    "actuator_lag": {"time_constant": 0.03},
    "torque_saturation": {"limit": 1.5},
}
ENCODER = {"channel_skew": {"delay": 0.0041}, "encoder_scale": {"scale": 1.05}}


def models():
    for model in (FLEXIBLE, STIFF, RIGID):
        yield model
    for model in (FLEXIBLE, RIGID):
        for name, values in ACTUATOR.items():
            yield model.with_effects(Effect(name, model.location("actuator"), values))
        for name, values in ENCODER.items():
            yield model.with_effects(Effect(name, model.location("motor_encoder"), values))


def signals():
    t = DT * np.arange(N)
    torque = 0.2 * np.sin(np.pi * t) + 0.05 * np.sign(np.sin(7 * t))
    angles = 0.1 * np.column_stack([np.sin(3.0 * t), np.sin(3.0 * t - 0.1)])
    angles[300:320] = np.nan
    return torque, angles


def near(one, other):
    return np.max(np.abs(one - other)) <= 1e-9 * np.max(np.abs(other))


@pytest.mark.parametrize("model", list(models()))
def test_the_matrix_of_a_sample_is_what_runge_kutta_does(model):
    stepped = model.with_effects(Effect("constant_torque", model.location("motor"), {"torque": 0.0}))
    torque, angles = signals()
    free = (*model.free_parameters(), *(INITIAL[::2] if model.rigid else INITIAL))
    assert len(pack(stepped).codes) == 1 and len(pack(model).codes) == 0
    rng = np.random.default_rng(1)
    gain = np.zeros((6, 2))
    gain[[0, 2, 4], 0] = 0.1, 2.0, 0.5
    if not model.rigid:
        gain[[1, 3, 5], 1] = 0.1, 2.0, 0.5
    # Four columns more, on which the observer alone depends.
    slopes = 1e-2 * rng.standard_normal((6, 2, len(free) + 4)), rng.standard_normal((2, len(free) + 4))
    options = {"gain": gain, "decay": (0.99, 0.98), "gain_slopes": slopes, "keep_states": True}
    options |= {"initial_state": [0.01, 0.01, 0.1, 0.1], "external_torque": 0.02 * torque[::-1].copy()}
    quick, slow = (predict(pack(m), torque, angles, DT, free, **options) for m in (model, stepped))
    for name in ("innovation", "d_innovation", "states", "d_states"):
        assert near(getattr(quick, name), getattr(slow, name)), name
    for column in range(len(free)):
        assert near(quick.d_innovation[:, :, column], slow.d_innovation[:, :, column]), free[column]
    plain, by_steps = (predict(pack(m), torque, angles, DT, gain=gain) for m in (model, stepped))
    assert near(plain.innovation, by_steps.innovation)
    assert near(plain.states, by_steps.states)
    assert near(simulate(model, torque, DT).states, simulate(stepped, torque, DT).states)
