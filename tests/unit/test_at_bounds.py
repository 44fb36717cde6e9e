"""A load that changes as the recording begins is the joint's inertia; a gain of which nothing is left after a
minute is no amplifier's; a friction without a second size is a friction."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from diagnosis_rigs import MODEL, fit_of

import haptic_teleop_sysid.diagnosis.decision.name_tests.at_bounds as at_bounds
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision.name_tests.at_bounds import within_bounds
from haptic_teleop_sysid.diagnosis.decision.search.decide import Choice
from haptic_teleop_sysid.diagnosis.decision.search.rounds import SearchResult
from haptic_teleop_sysid.diagnosis.hypotheses.explanation import Explanation

LOAD = Effect("payload_change", "stage1_motor", {"time": 0.0, "inertia": 0.6})
FRICTION = Effect("coulomb_friction", "stage1_motor", {"torque": 0.3})


def result(*effects, at_bound, by_current=0.0):
    final = replace(fit_of(MODEL.with_effects(*effects)), at_bound=at_bound)
    chosen = [Explanation(final, 30.0, 20.0, True, k, by_current=by_current) for k in range(len(effects))]
    scales = SimpleNamespace(size={"torque": 1.0})
    return SearchResult(fit_of(MODEL), final, tuple(Choice(one, 1.0) for one in chosen), (), scales)


def names(found):
    return [c.chosen.effect.effect for c in found.choices]


@pytest.mark.parametrize(
    ("effect", "bound", "stays"),
    [
        (LOAD, "time", False),
        (replace(LOAD, parameters={"time": 3.0, "inertia": 0.6}), None, True),
        (Effect("gain_drift", "stage1_actuator", {"change": -0.99, "time_constant": 56.0}), "change", False),
        (
            Effect("gain_drift", "stage1_actuator", {"change": -0.2, "time_constant": 0.05}),
            "time_constant",
            True,  # quick, and of a size
        ),
        (
            Effect("stribeck_friction", "stage1_motor", {"coulomb": 0.0, "breakaway": 0.3, "velocity": 1.0}),
            "coulomb",
            True,  # none of it
        ),
        (
            Effect("angle_dependent_inertia", "stage1_arm", {"amplitude": 0.95, "order": 1.0}),
            "amplitude",
            False,
        ),
    ],
)
def test_a_size_or_a_moment_at_the_end_of_what_is_possible(effect, bound, stays):
    at_bound = (f"{effect.location}.{effect.effect}.{bound}",) if bound else ()
    before = result(effect, at_bound=at_bound)
    after, doubt = within_bounds(before, [])
    if stays:
        assert (after, doubt) == (before, None)
    else:
        assert not after.choices and after.final is before.baseline
        assert doubt is not None and bound in doubt.why and "possible" in doubt.why


def test_the_others_stay(monkeypatch):
    rest = fit_of(MODEL.with_effects(FRICTION))
    monkeypatch.setattr(at_bounds, "without", lambda result, effect, records: rest)
    after, doubt = within_bounds(result(FRICTION, LOAD, at_bound=("stage1_motor.payload_change.time",)), [])
    assert names(after) == ["coulomb_friction"] and doubt is None and after.final is rest
    assert [one.found.effect.effect for one in after.given_up] == ["payload_change"]


def test_what_the_currents_show_is_not_asked():
    before = result(LOAD, at_bound=("stage1_motor.payload_change.time",), by_current=9.0)
    assert within_bounds(before, []) == (before, None)


@pytest.mark.parametrize(("time", "stays"), [(0.3, False), (12.0, True)])
def test_what_is_fitted_again_must_still_deserve_its_name(time, stays):
    """Beside what was left, a load changed 0.3 s after the recordings of 20 s had begun."""
    found = replace(LOAD, parameters={"time": 10.0, "inertia": 0.6})
    before = result(found, at_bound=())
    again = fit_of(MODEL.with_effects(replace(LOAD, parameters={"time": time, "inertia": 0.6})))
    scales = SimpleNamespace(size={"torque": 1.0}, at=lambda location: at, driven=lambda model: scales)
    at = SimpleNamespace(size={"duration": 20.0, "inertia": 0.1})
    after, doubt = within_bounds(replace(before, final=again, scales=scales), [])
    assert bool(after.choices) == stays and (doubt is None) == stays
