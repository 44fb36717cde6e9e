"""Names that a curve outdoes are given up, and right names stay; on recordings of an integrator of the tests'
own."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest
from diagnosis_rigs import explanation, result_of
from own_joint_records import LAB, errors_of, records

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision.name_tests.curve_instead import outdone
from haptic_teleop_sysid.diagnosis.decision.search.decide import Choice
from haptic_teleop_sysid.diagnosis.evidence.measured_map import MeasuredMap, measured_map
from haptic_teleop_sysid.diagnosis.hypotheses.explanation import Explanation
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales, within_reach
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch

ERRS = lambda model: (0.1, 0.1)  # noqa: E731
MAP = SimpleNamespace(effect="torque_map", location="stage1_arm")


@pytest.mark.parametrize(
    ("explained", "closed", "kept"),
    [(0.63, 0.43, False), (0.57, 0.9, True), (0.99, 0.38, True), (None, None, True)],
)
def test_a_curve_takes_the_place_of_names_where_it_explains_and_simulates_more(explained, closed, kept):
    choice = Choice(explanation("gravity", 100.0, 100.0), 1.0)
    found = MeasuredMap("", None if closed is None else MAP, None, explained, closed, ("arm angle",))
    result, doubt = outdone(result_of(choice), ERRS, lambda result, least: found)
    assert bool(result.choices) == kept and (doubt is None) == kept
    close = outdone(result_of(choice), lambda model: (0.5, 0.02), lambda result, least: found)
    assert close[0].choices, "what simulates well needs no curve"
    if doubt is not None:
        assert doubt.choice is choice and doubt.short
        assert "a torque over arm angle at stage1_arm explains 63 %" in doubt.why
        assert result.final is result.baseline


def test_what_currents_show_is_no_torque_of_the_motion():
    shown = replace(explanation("input_delay", 100.0, 100.0, "actuator", delay=0.01), by_current=80.0)
    result = result_of(*(Choice(one, 1.0) for one in (shown, explanation("gravity", 100.0, 100.0))))
    assert outdone(result, ERRS, lambda result, least: pytest.fail("nothing to outdo")) == (result, None)


@pytest.mark.parametrize(
    ("law", "numbers", "name", "place", "start", "kept"),
    [
        (5, (1.2, 0.3), "spring_to_ground", "arm", {"stiffness": 0.5, "rest": 0.3}, False),
        (3, (0.3, 0.25, 0.2), "gravity", "arm", {"torque": 0.2, "phase": 0.0}, False),
        (1, (0.3, 2.0, 0.6), "angle_dependent_inertia", "arm",
         {"amplitude": 0.25, "order": 2.0, "phase": 0.6}, True),
    ],
)  # fmt: skip
def test_of_physics_with_a_name_and_without(law, numbers, name, place, start, kept):
    learn, judge = records(law, *numbers)
    limits = within_reach(LAB, recording_scales(LAB, learn))
    named = fit_from_scratch(LAB.with_effects(Effect(name, f"stage1_{place}", start)), learn, limits=limits)
    result = result_of(Choice(Explanation(named, 100.0, 100.0, True, 0), 1.0))

    def drawn(one, least):
        return measured_map(named, LAB, learn, judge, errors_of(learn, judge), least=least)

    left, doubt = outdone(result, errors_of(learn, judge), drawn)
    assert bool(left.choices) == kept, doubt
