"""A richer form of friction that says no more than the plain one once the rest is found."""

import math
from dataclasses import replace

import pytest
from diagnosis_rigs import MODEL, joint_record

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision.search.decide import Choice
from haptic_teleop_sysid.diagnosis.decision.search.plainer_form import told_plainly
from haptic_teleop_sysid.diagnosis.hypotheses.explanation import Explanation
from haptic_teleop_sysid.estimation.tuning import initial_noise
from haptic_teleop_sysid.estimation.whole_fit import fit_whole

SIZE, ORDER = 0.5, 6.0
VARIED = Effect(
    "position_dependent_friction",
    "stage1_motor",
    {"torque": SIZE, "amplitude": 0.05, "order": ORDER, "phase": 0.2},
)
CONSTANT = Effect("constant_torque", "stage1_arm", {"torque": 0.01})


@pytest.mark.parametrize(("amplitude", "name"), [(0.0, "coulomb_friction"), (0.3, VARIED.effect)])
def test_a_form_whose_shape_gains_nothing_beside_the_rest_is_told_plainly(amplitude, name):
    def friction(angle, rate):
        return -(SIZE + amplitude * math.sin(ORDER * angle + 0.2)) * math.tanh(rate / 0.005)

    record = joint_record(3, seconds=5.0, rms=0.3, motor_friction=friction)
    noise = initial_noise(pack(MODEL), [record])
    fits = [
        fit_whole(MODEL.with_effects(*effects), noise, [record], iterations=20)
        for effects in ((VARIED,), (VARIED, CONSTANT))
    ]
    first, second = (Explanation(fit, 100.0, 50.0, True, i) for i, fit in enumerate(fits))
    without = MODEL.with_effects(Effect("coulomb_friction", "stage1_motor", {"torque": SIZE}))
    plain = Explanation(replace(fits[0], model=without), 90.0, 45.0, True, 0)
    elsewhere = MODEL.with_effects(Effect("coulomb_friction", "stage1_arm", {"torque": SIZE}))
    arm = Explanation(replace(fits[0], model=elsewhere), 80.0, 40.0, True, 0)
    choices = [Choice(first, 0.7, ((arm, 0.2), (plain, 0.1))), Choice(second, 1.0)]
    told = told_plainly(choices, [record], {})
    assert told[0].chosen.effect.effect == name
    assert [e.effect for e in told[-1].chosen.fit.model.effects] == [name, "constant_torque"]
    size = told[-1].chosen.fit.model.effects[0].parameters["torque"]
    assert size == pytest.approx(SIZE, rel=0.15)
    if name == "coulomb_friction":
        assert told[0].others == ((arm, 0.2),), "the plain form is no rival of itself"
        assert told[0].confidence == pytest.approx(0.8)
        assert told[0].chosen.gain == plain.gain
    else:
        assert told == choices


def test_the_last_one_is_asked_by_nothing_found_after_it():
    assert told_plainly([], [], {}) == []
