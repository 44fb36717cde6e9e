"""Sizes fitted to free runs: dry friction that sticks makes their error rough, a smoothed sign does not."""

import math

import numpy as np
import pytest
from numba import njit
from stepped_machines import DT, FINE, RIGID, pendulum

from haptic_teleop_control.errors import ModelError
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision.second_method.free_run_sizes import (
    as_fitted,
    freely_sized,
    sized_freely,
    turning_limits,
)
from haptic_teleop_sysid.diagnosis.evidence.certainty import standard_errors
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.searched_groups import Group
from haptic_teleop_sysid.diagnosis.evidence.second_method import JudgedGroup
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch
from haptic_teleop_sysid.recordings.dataset import DataSet
from haptic_teleop_sysid.simulation.parameter_fit import ParameterFit, fit_output_error
from haptic_teleop_sysid.simulation.windows import cut

INERTIA, DAMPING, WEIGHT, FRICTION, WITHIN = 0.14, 0.02, 3.0, 0.22, 0.08


@njit
def greased(torque, speed):
    """Angles (n,) of a pendulum that starts at rest, with friction whose sign turns within WITHIN rad/s;
    ``speed`` (n,): its velocity, filled in."""
    q, v, h = 0.0, 0.0, DT / FINE
    found = np.empty(len(torque))
    for k in range(len(torque)):
        found[k], speed[k] = q, v
        for _ in range(FINE):
            rubs = DAMPING * v + FRICTION * math.tanh(v / WITHIN)
            v += h * (torque[k] - rubs - WEIGHT * math.sin(q)) / INERTIA
            q += h * v
    return found


def swung_up():
    """4 s of a swing from rest, as a motor's noisy torque drives it and a coarse encoder reads it."""
    luck, t = np.random.default_rng(3), DT * np.arange(2000)
    torque = (0.4 + 0.4 * t) * np.sin(3.2 * t) + luck.normal(0.0, 0.15, len(t))
    speed = np.zeros(len(t))
    angle = 1e-3 * np.round(greased(torque, speed) / 1e-3)
    return DataSet(
        "made here", "generic", "j", DT, torque, "N*m", "measured effort", angle, speed,
        valid=np.ones(len(t), dtype=bool),
    )  # fmt: skip


def judged(gravity, friction, inertia):
    """What the inverse dynamics would have said."""
    effects = (
        Effect("gravity", "j_motor", {"torque": gravity, "phase": 0.0}),
        Effect("coulomb_friction", "j_motor", {"torque": friction}),
    )
    model = RIGID.with_values({"motor_inertia": inertia, "motor_damping": 0.0}).with_effects(*effects)
    std = dict.fromkeys(model.free_parameters(), 0.01)
    return JudgedGroup(Group(model, (), 50.0, 90.0, 0.9, std), 60.0, (0.5, 0.5))


def test_sizes_do_not_depend_on_where_the_search_began():
    data = swung_up()
    windows = cut(data, None, "as asked")
    fastest = float(np.max(np.abs(data.motor_velocity)))

    def simulated(model):
        return fit_output_error(model, [(data, windows)], turning_limits(model, fastest))

    stuck = []
    for gravity, inertia in ((3.6, 0.19), (3.3, 0.16)):
        start = judged(gravity, 0.15, inertia)
        stuck.append(simulated(start.group.model).model.parameter_values()["j_motor.gravity.torque"])
        taken = sized_freely(start, simulated, lambda model: (0.01, 0.01), fastest).group.model
        found = taken.parameter_values()
        assert found["j_motor.gravity.torque"] == pytest.approx(WEIGHT, rel=0.01)
        assert found["j_motor.coulomb_friction.torque"] == pytest.approx(FRICTION, rel=0.02)
        assert found["motor_inertia"] == pytest.approx(INERTIA, rel=0.01)
        # What is handed on sticks, as its name says.
        assert found["j_motor.coulomb_friction.smoothing"] == 0.0
    # Friction that sticks ended wherever the search happened to stop.
    assert abs(stuck[0] - stuck[1]) > 0.1 and min(stuck) > 1.02 * WEIGHT


def test_friction_sticks_unless_a_smoothed_sign_errs_clearly_less():
    start, name = judged(3.0, 0.2, 0.14), "j_motor.coulomb_friction.torque"

    def simulated(cost, fled=()):
        def fitted(model):
            smooth = model.parameter_values()["j_motor.coulomb_friction.smoothing"] > 0.0
            other = model.with_values({name: 0.3 if smooth else 0.25})
            return ParameterFit(other, True, (2.0, cost if smooth else 1.0), 9, fled if smooth else ())

        return fitted

    def taken(*args):
        found = sized_freely(start, simulated(*args), lambda model: (0.1, 0.1), 4.0)
        return found.group.model.parameter_values()[name]

    assert taken(0.7) == 0.3
    assert taken(0.9) == 0.25
    assert taken(0.7, ("motor_inertia",)) == 0.25


def test_the_velocity_of_a_smoothed_sign_stays_near_a_share_of_the_top_speed():
    model = RIGID.with_effects(
        Effect("coulomb_friction", "j_motor", {"torque": 0.2, "smoothing": 0.1}),
        Effect("gravity", "j_motor", {"torque": 3.0, "phase": 0.0}),
    )
    assert turning_limits(model, 5.0) == {
        "j_motor.coulomb_friction.smoothing": (pytest.approx(0.02), pytest.approx(0.5))
    }
    assert turning_limits(RIGID, 5.0) == {}


@pytest.fixture(scope="module")
def predicted():
    """A pendulum with a weight that is named, fitted to predictions, and its recording."""
    records = [pendulum(0, weight=2.0)]
    model = RIGID.with_effects(Effect("gravity", "j_motor", {"torque": 2.0, "phase": 0.0}))
    return fit_from_scratch(model, records), records


def wanted(model, std=0.01, fled=(), **values):
    changed = model.with_values({n.replace("__", "."): v for n, v in values.items()})
    return ParameterFit(changed, True, (1.0, 0.5), 9, fled, dict.fromkeys(model.free_parameters(), std))


def test_the_parameters_that_free_runs_want_come_with_their_errors(predicted):
    fit, records = predicted
    sized = freely_sized(fit, lambda model: wanted(model, motor_damping=0.33), records, 5.0)
    assert sized.model.parameters["motor_damping"] == 0.33
    assert math.isfinite(sized.log_likelihood)
    assert standard_errors(sized)["motor_damping"] == pytest.approx(0.01)
    # Where free runs do not determine all of them, predictions say how well they are known.
    sized = freely_sized(fit, lambda model: wanted(model, math.nan, motor_damping=0.33), records, 5.0)
    assert standard_errors(sized) == pytest.approx(standard_errors(fit), rel=1e-6)


def test_what_is_not_determined_stays_so(predicted):
    fit, records = predicted
    std = dict.fromkeys(fit.model.free_parameters(), 0.01) | {"motor_inertia": math.inf}
    assert math.isinf(standard_errors(as_fitted(fit.model, std, fit, records))["motor_inertia"])


def test_free_runs_that_want_another_machine_or_another_size_of_a_name_are_not_followed(predicted):
    fit, records = predicted

    def fails(model):
        raise ModelError("nothing to fit")

    for simulated in (
        fails,
        lambda model: wanted(model, fled=("motor_inertia",)),
        lambda model: wanted(model, j_motor__gravity__torque=0.5),
        lambda model: wanted(model, motor_inertia=math.nan),
    ):
        assert freely_sized(fit, simulated, records, 5.0) is None
