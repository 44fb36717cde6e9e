"""Thinned recordings: the mean of the input over some samples acts as the samples did."""

from dataclasses import replace

import numpy as np
import pytest
from identification_plants import STAGE, multisine

from haptic_teleop_sim.kernel import pack, predict, simulate
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.estimation.records import Record, thinned

DT, N, K = 1e-3, 4000, 5


def record(model):
    current = multisine(N, DT, 0.12, (0.2, 12.0), 3)
    run = simulate(model, current, DT)
    measured = np.column_stack([run.motor_position, run.arm_position])
    return Record("one", DT, current, measured, np.zeros(N), (1e-6, 1e-6))


def error(model, one, moment):
    found = predict(pack(model), one.input, one.measured, one.dt, moment=moment, initial_state=np.zeros(4))
    return float(np.std(found.innovation[:, 0]))


def test_what_changes_within_a_sample_moves_the_motor_as_far():
    few = thinned(record(STAGE), 1.0 / (K * DT))
    assert few.dt == pytest.approx(K * DT)
    with_moment, without = (error(STAGE, few, m) for m in (few.moment, None))
    assert with_moment < 0.2 * without
    # A recording that is not thinned has none, and is predicted exactly.
    assert thinned(record(STAGE), 1.0 / DT).moment is None
    assert error(STAGE, record(STAGE), None) < 1e-9


def test_the_moment_is_that_of_the_torque_about_the_end_of_its_sample():
    draw = np.random.default_rng(2)
    one = Record("one", DT, draw.normal(size=N), np.zeros((N, 2)), np.zeros(N), (1e-6, 1e-6))
    few = thinned(one, 1.0 / (K * DT))
    # A free mass: twice the integral of the force.
    speed = np.concatenate([[0.0], np.cumsum(one.input) * DT])
    way = np.concatenate([[0.0], np.cumsum(0.5 * DT * (speed[1:] + speed[:-1]))])[::K]
    speed = speed[::K]
    moved = speed[:-1] * few.dt + 0.5 * few.input * few.dt**2 + few.moment
    assert np.diff(way) == pytest.approx(moved, abs=1e-12)


@pytest.mark.parametrize(
    "effects", [(), (Effect("input_delay", "stage1_actuator", {"delay": 0.003}),)], ids=["none", "late"]
)
def test_derivatives_contain_the_moment(effects):
    model = replace(STAGE, effects=effects)
    few = thinned(record(model), 1.0 / (K * DT))

    def run(one, free=()):
        return predict(pack(one), few.input, few.measured, few.dt, free, moment=few.moment)

    for name in ("torque_constant", "motor_inertia", "motor_damping"):
        value = model.parameters[name]
        step = 1e-4 * value
        up, down = (run(model.with_values({name: value + s})).innovation for s in (step, -step))
        slope = run(model, (name,)).d_innovation[:, :, 0]
        assert slope == pytest.approx((up - down) / (2 * step), rel=1e-4, abs=1e-6 * np.max(np.abs(slope)))


def test_no_moment_is_asked_for_where_the_input_has_none(monkeypatch):
    """Columns of an empty array were read beyond its end."""
    import importlib

    module = importlib.import_module("haptic_teleop_sim.kernel.predict")
    real, handed = module.kernel(), []

    class Watched:
        PITCH = real.PITCH

        def predict_series(self, *given):
            handed.append(given[10].shape)
            real.predict_series(*given)

    monkeypatch.setattr(module, "kernel", Watched)
    one = record(STAGE)
    predict(pack(STAGE), one.input, one.measured, one.dt, ("torque_constant",))
    assert handed == [(0, 0)]
