"""The augmented model of something unknown holds the friction that is named beside it."""

from dataclasses import replace

import numpy as np
import pytest
from stepped_machines import RIGID, drive, record, swing

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision.unknown.simulating_model import not_in, with_the_named
from haptic_teleop_sysid.diagnosis.decision.verdict import Verdict
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.band import motion_band
from haptic_teleop_sysid.diagnosis.evidence.measured_map import MeasuredMap, measured_map
from haptic_teleop_sysid.estimation.whole_fit import fit_whole, noise_starts

TRUE = RIGID.with_values({"motor_inertia": 0.14, "motor_damping": 0.35})
#: What the recordings contain: dry friction, and an amplifier that pushes better than it pulls.
FRICTION, PUSHES = 0.3, 0.15


def made(seed):
    torque = drive(seed, 2.0)
    acts = torque + PUSHES * np.abs(torque)
    return [record(torque, swing(acts, 0.14, 0.35, FRICTION, 0.0, 0.0, 0.0, 0.0)[:, None], 1e-5)]


@pytest.fixture(scope="module")
def bare():
    learn, judge = made(0), made(1)
    return fit_whole(TRUE, noise_starts(TRUE, learn)[1], learn, iterations=8), learn, judge


def named(*findings):
    told = [{"effect": e, "location": place, "parameters": p} for e, place, p in findings]
    return Verdict("unknown", [], told, [], [])


RUBS = ("coulomb_friction", "j_motor", {"torque": {"value": FRICTION}})


def fewer(model):
    """Errors of free runs that fall with every effect."""
    return (1.0 / (1.0 + len(model.effects)),) * 2


def as_it_is(fit):
    """Free runs that want no other parameters."""


def test_beside_the_named_friction_the_map_of_the_rest_is_the_amplifier_s(bare):
    fit, learn, judge = bare
    cutoff = motion_band([*learn, *judge])

    def draw(base):
        return measured_map(base, RIGID, learn, judge, fewer, cutoff=cutoff)

    # Without the friction nothing follows the input.
    assert draw(fit).quantities != ("input torque",)
    found = with_the_named(named(RUBS), fit, fit, RIGID, learn, fewer, as_it_is, draw)
    friction, curve = found.fit.model.effects
    assert friction.values["torque"] == FRICTION and curve.table.variables == ("input",)
    at = np.array([-2.0, 2.0])
    assert curve.table.at(at) == pytest.approx(2.0 * np.array([PUSHES, PUSHES]), abs=0.06)
    assert found.mapped.law is not None and not not_in(named(RUBS), found.fit.model)


@pytest.mark.parametrize(("errors", "taken"), [(fewer, True), (lambda model: (0.5, 0.5), False)])
def test_the_model_with_it_is_taken_if_its_free_runs_err_less(bare, errors, taken):
    fit, learn, _ = bare
    none = MeasuredMap("no map was added")
    found = with_the_named(named(RUBS), fit, fit, RIGID, learn, errors, as_it_is, lambda base: none)
    assert (found is not None) == taken
    if found is not None:
        (friction,) = found.fit.model.effects
        assert (friction.effect, friction.values["torque"]) == ("coulomb_friction", FRICTION)


def test_beside_it_the_structure_is_the_one_that_simulates_best(bare):
    fit, learn, _ = bare
    none = MeasuredMap("no map was added")

    def freely(one):
        return replace(one, model=one.model.with_values({"motor_inertia": 0.2}))

    for at_best, inertia in ((0.2, 0.2), (0.14, 0.14)):

        def errors(model, at_best=at_best):
            off = abs(model.parameters["motor_inertia"] - at_best)
            return (1.0 / (1.0 + len(model.effects)) + off,) * 2

        found = with_the_named(named(RUBS), fit, fit, RIGID, learn, errors, freely, lambda base: none)
        assert found.fit.model.parameters["motor_inertia"] == pytest.approx(inertia, rel=0.1)
        assert found.fit.model.effects[0].values["torque"] == FRICTION


def test_a_friction_that_the_model_has_in_another_form_is_not_put_in_twice(bare):
    fit, learn, _ = bare
    rich = Effect("stribeck_friction", "j_motor", {"coulomb": 0.3, "breakaway": 0.4, "velocity": 0.1})
    assert not_in(named(RUBS), fit.model.with_effects(rich)) == []
    delay = ("sensor_delay", "j_motor_encoder", {"delay": {"value": 0.01}})
    assert not_in(named(delay), fit.model) == []  # no torque along the motion
