"""What no recording can tell apart is put up for choice together."""

import numpy as np
import pytest
from test_diagnosis_parts import DT, MODEL, NOISE, joint_record

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision.decide import choose
from haptic_teleop_sysid.diagnosis.evidence.certainty import standard_errors
from haptic_teleop_sysid.diagnosis.hypotheses.explanation import Explanation
from haptic_teleop_sysid.diagnosis.hypotheses.twins import twins, with_twins
from haptic_teleop_sysid.estimation.gauss_newton import Fit
from haptic_teleop_sysid.estimation.likelihood import innovations


@pytest.mark.parametrize(
    ("effect", "place", "delay", "other", "others_delay"),
    [
        ("sensor_delay", "arm_encoder", 0.003, "channel_skew", 0.003),
        ("channel_skew", "motor_encoder", 0.003, "sensor_delay", 0.003),
        ("input_delay", "actuator", 0.004, "channel_skew", -0.004),
        ("channel_skew", "actuator", -0.004, "input_delay", 0.004),
    ],
)
def test_a_delay_and_a_stamp_are_twins(effect, place, delay, other, others_delay):
    found = twins(Effect(effect, f"stage1_{place}", {"delay": delay}), rigid=False)
    assert found == [Effect(other, f"stage1_{place}", {"delay": others_delay})]


@pytest.mark.parametrize(
    ("effect", "place", "parameters"),
    [
        ("channel_skew", "arm_encoder", {"delay": -0.003}),
        ("channel_skew", "actuator", {"delay": 0.004}),
        ("actuator_lag", "actuator", {"time_constant": 0.004}),
    ],
)
def test_what_comes_too_early_has_no_twin(effect, place, parameters):
    assert twins(Effect(effect, f"stage1_{place}", parameters), rigid=False) == []


def test_a_twin_predicts_the_same_and_both_are_named():
    record = joint_record(4)
    model = MODEL.with_effects(Effect("input_delay", "stage1_actuator", {"delay": 2.3 * DT}))
    names = model.free_parameters()
    information = 1e10 * (np.diag(np.arange(1.0, len(names) + 1.0)) + 0.1)
    fit = Fit(model, NOISE, names, 0.0, information, np.ones(len(names)), True, 1, "as given")
    both = with_twins([Explanation(fit, 300.0, 200.0, True, 0)])
    assert [e.effect.effect for e in both] == ["input_delay", "channel_skew"]
    errors = [innovations(pack(e.fit.model), NOISE, record).innovation for e in both]
    # What was commanded before the record begins and after its end is not there.
    inner = slice(250, -3)
    np.testing.assert_allclose(errors[0][inner], errors[1][inner], atol=1e-3 * np.std(errors[0]))
    stds = [list(standard_errors(e.fit).values()) for e in both]
    np.testing.assert_allclose(stds[0], stds[1])
    assert both[1].fit.free == both[1].fit.model.free_parameters()
    assert choose(both, 0.0, False).ambiguous
    assert with_twins(both) == both
