"""Is a size the same in every stretch of the recordings? Machines of `stepped_machines`."""

import math
from dataclasses import replace

import numpy as np
import pytest
from stepped_machines import ELASTIC, RIGID, pendulum, record, two_masses

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision.name_tests.size_over_time import constant_sizes
from haptic_teleop_sysid.diagnosis.decision.search.decide import Choice
from haptic_teleop_sysid.diagnosis.decision.search.rounds import SearchResult
from haptic_teleop_sysid.diagnosis.evidence.steadiness import (
    Steadiness,
    _steadiness,
    spread_by_stretch,
    steadiness,
)
from haptic_teleop_sysid.diagnosis.hypotheses.explanation import Explanation
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales
from haptic_teleop_sysid.estimation.tuning import initial_noise
from haptic_teleop_sysid.estimation.whole_fit import fit_whole

CUTOFF = 8.0
FRICTION = Effect("coulomb_friction", "j_motor", {"torque": 0.4})
WEIGHT = Effect("gravity", "j_motor", {"torque": 2.0, "phase": 0.0})
RIPPLE = Effect("torque_ripple", "j_motor", {"amplitude": 0.1, "order": 23.0, "phase": 0.0})
AT_MOTOR = ("coulomb_friction", "j_motor")


def of(records, *effects):
    return steadiness(RIGID.with_effects(*effects), effects, records, CUTOFF)


def test_friction_and_weight_are_constants_of_a_joint():
    found = of([pendulum(0, coulomb=0.4, weight=2.0), pendulum(1, coulomb=0.4, weight=2.0)], FRICTION, WEIGHT)
    for one in found.values():
        assert len(one.sizes) == 8
        assert one.mean == pytest.approx(1.0, abs=0.05)
        assert one.off < 0.05


def test_a_size_that_is_off_is_off_by_as_much():
    (one,) = of([pendulum(0, coulomb=0.6), pendulum(1, coulomb=0.6)], FRICTION).values()
    assert one.mean == pytest.approx(1.5, rel=0.05)
    assert one.off == pytest.approx(0.5, abs=0.06)


def test_friction_that_is_another_one_in_the_other_recording_varies():
    (one,) = of([pendulum(0, coulomb=0.2), pendulum(1, coulomb=0.6)], FRICTION).values()
    half = len(one.sizes) // 2
    assert np.mean(one.sizes[:half]) == pytest.approx(0.5, abs=0.1)
    assert np.mean(one.sizes[half:]) == pytest.approx(1.5, abs=0.1)
    assert one.spread == pytest.approx(np.std([0.5] * 4 + [1.5] * 4, ddof=1), rel=0.2)


def test_what_is_not_there_has_no_size():
    found = of([pendulum(0, coulomb=0.4), pendulum(1, coulomb=0.4)], FRICTION, RIPPLE)
    assert found["torque_ripple", "j_motor"].off == pytest.approx(1.0, abs=0.15)
    assert found[AT_MOTOR].off < 0.05


def test_with_equal_errors_the_spread_is_the_variance_beyond_them():
    """The closed form of Paule and Mandel's estimator where all standard errors are one."""
    sizes = np.array([0.3, 1.4, 0.8, 1.9, 1.1])
    one = _steadiness(sizes, np.full(5, 0.2))
    assert one.mean == pytest.approx(np.mean(sizes))
    assert one.spread**2 == pytest.approx(np.var(sizes, ddof=1) - 0.04)
    assert one.error == pytest.approx(math.sqrt(np.var(sizes, ddof=1) / 5))
    alike = _steadiness(sizes, np.full(5, 0.6))
    assert alike.spread == 0.0, "chance: the sizes differ by about their errors"


def test_a_size_is_told_with_what_it_is_off_by():
    model = RIGID.with_effects(FRICTION, WEIGHT)
    steady = {AT_MOTOR: Steadiness(np.ones(2), np.ones(2), 1.0, 0.1, 0.25)}
    assert spread_by_stretch(steady, model) == {"j_motor.coulomb_friction.torque": pytest.approx(0.1)}


def test_a_flexible_joint_and_a_short_recording_are_not_asked():
    torque = 2.0 * np.sin(np.arange(4000) * 0.01)
    elastic = record(torque, two_masses(torque, 20.0, (0.06, 0.3), (0.1, 0.02), 0.3))
    arm = Effect("coulomb_friction", "j_arm", {"torque": 0.3})
    assert steadiness(ELASTIC.with_effects(arm), [arm], [elastic], CUTOFF) == {}
    whole = pendulum(0, coulomb=0.4)
    short = replace(
        whole, input=whole.input[:300], measured=whole.measured[:300], exogenous=whole.exogenous[:300]
    )
    assert of([short], FRICTION) == {}


def result_of(records, *effects):
    like = fit_whole(RIGID, initial_noise(pack(RIGID), records), records, iterations=1)
    fit = replace(like, model=RIGID.with_effects(*effects))
    choices = tuple(Choice(Explanation(fit, 50.0, 20.0, True, i), 0.9) for i in range(len(effects)))
    return SearchResult(like, fit, choices, (), recording_scales(RIGID, records))


def test_a_name_that_is_no_constant_goes_and_the_others_stay():
    records = [pendulum(0, coulomb=0.4), pendulum(1, coulomb=0.4)]
    result = result_of(records, FRICTION, RIPPLE)
    found, doubt = constant_sizes(
        result, lambda r: steadiness(r.final.model, r.final.model.effects, records, CUTOFF), records
    )
    assert [c.chosen.effect.effect for c in found.choices] == ["coulomb_friction"]
    assert [e.effect for e in found.final.model.effects] == ["coulomb_friction"]
    assert "no constant of the joint" in found.given_up[0].why
    assert doubt is None


def test_where_the_only_name_is_no_constant_something_unknown_is_there():
    records = [pendulum(0, coulomb=0.4), pendulum(1, coulomb=0.4)]
    found, doubt = constant_sizes(
        result_of(records, RIPPLE),
        lambda r: steadiness(r.final.model, r.final.model.effects, records, CUTOFF),
        records,
    )
    assert found.choices == () and found.final is found.baseline
    assert doubt is not None and doubt.choice.chosen.effect.effect == "torque_ripple"
