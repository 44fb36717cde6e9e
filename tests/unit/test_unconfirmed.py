"""Nobody is sure of what the other recordings say nothing of."""

from dataclasses import replace

import numpy as np
import pytest
from stepped_machines import RIGID, pendulum

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision.finding import finding
from haptic_teleop_sysid.diagnosis.decision.name_tests.unconfirmed import unconfirmed
from haptic_teleop_sysid.diagnosis.decision.search.decide import Choice
from haptic_teleop_sysid.diagnosis.decision.search.rounds import SearchResult
from haptic_teleop_sysid.diagnosis.hypotheses.explanation import Explanation
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales
from haptic_teleop_sysid.estimation.whole_fit import fit_whole, noise_starts

STOP = Effect("hard_stop", "j_motor", {"angle": 2.0, "stiffness": 500.0})
SPRING = Effect("spring_to_ground", "j_motor", {"stiffness": 3.0, "rest": 0.0})


@pytest.fixture(scope="module")
def result():
    learn = [pendulum(0)]
    model = RIGID.with_effects(SPRING, STOP)
    fit = fit_whole(model, noise_starts(model, learn)[1], learn, free=(), iterations=2)
    base = replace(fit, model=RIGID)
    choices = tuple(Choice(Explanation(fit, 50.0, 50.0, True, index), 0.99) for index in (0, 1))
    return SearchResult(base, fit, choices, (), recording_scales(RIGID, learn))


def responses(reach):
    """Simulated angles that get as far as ``reach``, which a spring holds back and a stop ends, if there."""

    def simulated(model):
        angle = reach * np.sin(np.linspace(0.0, 20.0, 500))
        for e in model.effects:
            if e.effect == "spring_to_ground":
                angle = angle / (1.0 + e.values["stiffness"])
        for e in model.effects:
            if e.effect == "hard_stop":
                angle = np.minimum(angle, e.values["angle"])
        return [{"j_motor.position": np.where(np.arange(500) < 3, np.nan, angle)}]

    return simulated


def test_a_stop_that_only_the_fitted_recordings_reach_is_not_sure(result):
    spring, stop = unconfirmed(result, responses(4.0)).choices
    assert spring.unsure == ""
    assert "hard stop" in stop.unsure and "record one that reaches it" in stop.unsure
    assert finding(stop, result.final, {})["confidence"] < 0.7
    assert all(c.unsure == "" for c in unconfirmed(result, responses(12.0)).choices)


def test_what_shows_in_the_currents_is_not_asked(result):
    stop = result.choices[1]
    seen = replace(stop, chosen=replace(stop.chosen, by_current=20.0))
    (kept,) = unconfirmed(replace(result, choices=(seen,)), responses(4.0)).choices
    assert kept.unsure == ""


@pytest.mark.parametrize(("order", "sure"), [(0.8, False), (7.0, True)])
def test_of_a_ripple_that_does_not_repeat_within_the_travel_nobody_is_sure(result, order, sure):
    ripple = Effect("torque_ripple", "j_motor", {"amplitude": 2.0, "order": order, "phase": 0.0})
    turns = result.scales.span(0) / (2.0 * np.pi)
    assert (order * turns > 1.5) == sure
    fit = replace(result.baseline, model=RIGID.with_effects(ripple))
    told = replace(result, final=fit, choices=(Choice(Explanation(fit, 50.0, 50.0, True, 0), 0.99),))

    def simulated(model):
        return [{"j_motor.position": np.arange(9.0) * (2.0 if model.effects else 1.0)}]

    (kept,) = unconfirmed(told, simulated).choices
    assert ("of its cycles lie in the travel" in kept.unsure) == (not sure)
    assert (finding(kept, fit, {})["confidence"] < 0.7) == (not sure)
