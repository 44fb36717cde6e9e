"""Stops and limits act in a part of the motion only: where they are sought, what their size is compared with,
and recordings that never reach them.  Recordings come from an integrator of the tests."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_rigs import MODEL, STEP, joint_record

from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.evidence import held_out
from haptic_teleop_sysid.diagnosis.hypotheses.material import material
from haptic_teleop_sysid.diagnosis.inputs.scales import Scales, recording_scales
from haptic_teleop_sysid.diagnosis.starts.scan import scanned_values
from haptic_teleop_sysid.diagnosis.starts.trials import finished
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch, fit_whole

ANGLE = next(p for p in EFFECTS["hard_stop"].parameters if p.scan)


def places(lowest: float, highest: float) -> list[float]:
    scales = Scales({"furthest": max(-lowest, highest)}, (lowest,) * 2, (highest,) * 2, 0.002, (STEP, STEP))
    return list(scanned_values(ANGLE, scales, "motor"))


@pytest.mark.parametrize(
    ("lowest", "highest", "stop"), [(-0.049, 0.6, -0.0445), (-0.6, 0.6, 0.55), (-0.6, 0.03, 0.027)]
)
def test_a_stop_is_sought_on_its_side_wherever_zero_lies(lowest, highest, stop):
    found = [angle for angle in places(lowest, highest) if angle * stop > 0.0]
    assert min(abs(angle - stop) for angle in found) < 0.02 * (highest - lowest)
    assert all(lowest < angle < highest for angle in found)


def test_no_stop_is_sought_at_an_end_that_is_on_the_other_side():
    """The sign of a stop's angle is its side: a lower one has a negative angle."""
    assert all(angle > 0.2 for angle in places(0.2, 0.6))
    assert all(angle < 0.0 for angle in places(-0.6, 0.001))


@pytest.fixture(scope="module")
def records():
    """One recording that runs into a stop of the arm, and one that does not."""
    reach = float(np.max(joint_record(3).measured[:, 1]))
    stop = 0.9 * reach
    wall = {"arm_torque": lambda q: -300.0 * max(q - stop, 0.0)}
    return stop, joint_record(3, **wall), joint_record(4, rms=0.05, **wall)


def explained(records, effect, monkeypatch, objection, known=0.0, gain=None):
    """How a further effect is judged when the other recordings lose ``objection`` nats by the parameters;
    ``known``: nats that speak for it already; ``gain``: nats that it gains, where not those it does."""
    _, learn, judge = records
    fit = fit_from_scratch(MODEL, [learn])
    wider = fit_whole(MODEL.with_effects(effect), fit.noise, [learn])
    monkeypatch.setattr(
        held_out,
        "all_reconciled",
        lambda both, _: [(0.0 if f.model.effects else objection, there.noise) for f, there in both],
    )
    monkeypatch.setattr(held_out, "by_blocks", lambda pairs: None)
    if gain is not None:
        wider = replace(wider, log_likelihood=fit.log_likelihood + gain)
    scales = recording_scales(MODEL, [learn])
    return held_out.judged(fit, [wider], [learn], [judge], scales, known=[known])[0]


def test_recordings_that_do_not_reach_a_stop_do_not_object_to_it(records, monkeypatch):
    stop, _, judge = records
    assert np.max(judge.measured[:, 1]) < 0.8 * stop
    effect = Effect("hard_stop", "stage1_arm", {"angle": stop, "stiffness": 300.0})
    gain = explained(records, effect, monkeypatch, 0.0)
    assert gain.gain > 100.0
    loss = gain.held_out + 0.04 * gain.gain
    assert explained(records, effect, monkeypatch, loss).elsewhere == 0.0
    # ... unless they lose so much that the structure beside it is wrong.
    assert explained(records, effect, monkeypatch, gain.held_out + 0.5 * gain.gain).elsewhere < 0.0


def test_what_the_currents_show_of_a_limit_counts_where_other_recordings_do_not_reach_it(
    records, monkeypatch
):
    """A saturation that the motion shows by 28 nats and the currents by 359 was not believed, for 3.7 nats
    that the recordings which never come near it lost by the structure's parameters."""
    effect = Effect("hard_stop", "stage1_arm", {"angle": records[0], "stiffness": 300.0})
    loss = explained(records, effect, monkeypatch, 0.0, gain=28.0).held_out + 3.7
    weak = explained(records, effect, monkeypatch, loss, gain=28.0)
    assert weak.gain == pytest.approx(28.0) and weak.elsewhere == pytest.approx(-3.7)
    assert explained(records, effect, monkeypatch, loss, gain=28.0, known=359.0).elsewhere == 0.0


def test_recordings_that_an_effect_does_reach_object_to_it(monkeypatch):
    """Friction acts everywhere."""
    rubbing = {"motor_friction": lambda _, v: -0.1 * np.tanh(v / 1e-3)}
    records = 0.0, joint_record(3, **rubbing), joint_record(4, rms=0.1, **rubbing)
    effect = Effect("coulomb_friction", "stage1_motor", {"torque": 0.1})
    found = explained(records, effect, monkeypatch, 3000.0)
    assert found.gain > 100.0 and found.elsewhere < -1000.0


def test_a_limit_is_judged_by_the_torque_constant_of_its_own_model(records):
    """A structure without its saturation makes up for it by the torque constant: by that one, no torque that
    was asked for reaches the limit."""
    _, learn, _ = records
    swallowed = replace(MODEL, parameters={**MODEL.parameters, "torque_constant": 3.0})
    peak = float(np.max(np.abs(learn.input)))
    saturation = Effect("torque_saturation", "stage1_actuator", {"limit": 0.5 * 8.925 * peak})
    scales = recording_scales(swallowed, [learn])
    assert not material(saturation, scales)
    own = scales.driven(MODEL)
    assert material(saturation, own)
    right = recording_scales(MODEL, [learn])
    for name in ("torque", "peak", "torque_per_angle", "peak_per_speed", "drag", "steep"):
        assert own.size[name] == pytest.approx(right.size[name])
    assert own.size["fastest"] == scales.size["fastest"]


def test_a_fit_that_stopped_at_the_limit_of_its_steps_goes_on_to_the_end(records):
    _, learn, _ = records
    whole = fit_from_scratch(MODEL, [learn])
    far = MODEL.with_values({"motor_inertia": 0.2, "motor_damping": 8.0})
    begun = fit_whole(far, whole.noise, [learn], iterations=1)
    assert not begun.converged and begun.log_likelihood < whole.log_likelihood - 10.0
    ended = finished(begun, [learn], {})
    assert ended.converged
    assert ended.log_likelihood == pytest.approx(whole.log_likelihood, abs=2.0)
    assert finished(ended, [learn], {}) is ended
