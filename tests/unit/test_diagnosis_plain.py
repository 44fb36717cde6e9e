"""What a linearisation does not see: large effects fitted from nothing, other things that load the joint."""

import math
from dataclasses import replace

import numpy as np
import pytest
from diagnosis_rigs import MODEL, RIGID, fit_of, joint_record

import haptic_teleop_sysid.diagnosis.starts.shadows as shadows_module
from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.hypotheses.candidates import candidates, plain_start
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales, within_reach
from haptic_teleop_sysid.diagnosis.starts.plain import plain
from haptic_teleop_sysid.diagnosis.starts.shadows import _at_rest, shadows, with_shadows
from haptic_teleop_sysid.diagnosis.starts.trials import polish, with_contact
from haptic_teleop_sysid.estimation.step_limits import bounds
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch


def nothing(text):
    """A progress that nobody reads."""


@pytest.fixture(scope="module")
def pulled():
    """The joint with 0.02 N·m that always pull at the motor, under 0.3 N·m rms of the input."""
    return [joint_record(4, rms=0.05, motor_torque=lambda angle: -0.02)]


@pytest.mark.long
def test_a_constant_torque_is_fitted_from_nothing(pulled):
    scales, limits = recording_scales(MODEL, pulled), within_reach(MODEL)
    fits = plain(MODEL, pulled, scales, limits, nothing)
    tried = {(f.model.effects[0].effect, f.model.effects[0].location) for f in fits}
    expected = {(e.effect, e.location) for e in candidates(MODEL, pulled, scales, {}) if e.entry.large}
    # A torque that always pulls, friction and a late torque are among them; what only bends a curve is not.
    assert {"constant_torque", "coulomb_friction", "input_delay"} <= {name for name, _ in tried}
    assert not {"torque_ripple", "hardening_spring"} & {name for name, _ in tried}
    assert tried == expected
    best = max(fits, key=lambda f: f.log_likelihood)
    found = next(
        f
        for f in fits
        if (f.model.effects[0].effect, f.model.effects[0].location[7:]) == ("constant_torque", "motor")
    )
    assert found.model.effects[0].parameters["torque"] == pytest.approx(-0.02, rel=0.05)
    assert found.log_likelihood > fit_from_scratch(MODEL, pulled).log_likelihood + 50.0
    assert found.log_likelihood > best.log_likelihood - 10.0


def test_plain_starts_lie_within_bounds_and_stops_at_either_end(pulled):
    scales = recording_scales(MODEL, pulled)
    for name, entry in EFFECTS.items():
        if not entry.large:
            continue
        for place in entry.where:
            several = plain_start(entry, scales, place)
            assert len(several) == {"hard_stop": 2, "input_delay": 3}.get(name, 1)
            for parameters in several:
                for n, value in parameters.items():
                    parameter = entry.parameter(n)
                    assert parameter.minimum <= value <= parameter.maximum
                MODEL.with_effects(Effect(name, MODEL.location(place), parameters))
    low, high = (p["angle"] for p in plain_start(EFFECTS["hard_stop"], scales, "motor"))
    assert low < 0.0 < high
    beyond = replace(scales, lowest=(0.5, 0.5), highest=(1.5, 1.5))
    (only,) = plain_start(EFFECTS["hard_stop"], beyond, "motor")
    assert 0.5 < only["angle"] < 1.5


def test_a_torque_at_the_motor_has_its_shadow_at_the_arm(pulled):
    limits = within_reach(MODEL)
    before = fit_from_scratch(MODEL, pulled, limits=limits)
    model = MODEL.with_effects(Effect("constant_torque", "stage1_motor", {"torque": -0.02}))
    start = replace(before, model=model, free=model.free_parameters())
    motor = polish(start, pulled, limits)
    cast = with_shadows([motor], before, pulled, limits)
    names = {(f.model.effects[0].effect, f.model.effects[0].location) for f in cast}
    assert names >= {("constant_torque", "stage1_arm"), ("gravity", "stage1_arm")}
    both = [f for f in cast if f.model.effects[0].effect == "constant_torque"]
    places = {f.model.effects[0].location: f for f in both}
    assert set(places) == {"stage1_motor", "stage1_arm"}
    # The encoders are zeroed with the joint loaded: nothing tells the two apart but the first moments.
    arm = places["stage1_arm"]
    assert arm.log_likelihood == pytest.approx(motor.log_likelihood, abs=3.0)
    values = arm.model.parameter_values()
    assert values["stage1_arm.constant_torque.torque"] == pytest.approx(-0.02, rel=0.1)
    assert values["stage1_joint.joint_preload.torque"] == pytest.approx(0.02, rel=0.1)


def test_what_does_not_load_the_joint_has_no_shadow():
    assert shadows(Effect("coulomb_friction", "stage1_motor", {"torque": 0.1})) == []
    spring = Effect("spring_to_ground", "stage1_arm", {"stiffness": 0.1, "rest": 0.2})
    assert [(e.effect, e.location) for e in shadows(spring)] == [
        ("spring_to_ground", "stage1_motor"),
        ("gravity", "stage1_arm"),
    ]


def test_a_spring_is_gravity_over_small_angles_and_gravity_a_spring():
    spring = Effect("spring_to_ground", "stage1_arm", {"stiffness": 0.1, "rest": 0.2})
    gravity = shadows(spring)[-1]
    t, phase = gravity.parameters["torque"], gravity.parameters["phase"]
    for q in (-0.02, 0.0, 0.03):
        # The contract's equations.
        assert -t * math.sin(q + phase) == pytest.approx(-0.1 * (q - 0.2), abs=2e-5)
    (back,) = shadows(gravity)
    assert back.parameters == pytest.approx(spring.parameters)
    hanging = Effect("gravity", "stage1_arm", {"torque": 0.1, "phase": math.pi / 2})
    assert shadows(hanging) == []


def test_no_shadow_falls_where_the_model_can_have_none_or_has_it_already(pulled):
    def start(model, *effects):
        wider = model
        for effect in effects:
            wider = wider.with_effects(effect)
        return replace(fit_of(wider), free=wider.free_parameters())

    pull = Effect("constant_torque", "j_motor", {"torque": -0.02})
    rigid = start(RIGID, pull)
    assert with_shadows([rigid], fit_of(RIGID), pulled, {}) == [rigid]
    present = Effect("spring_to_ground", "stage1_arm", {"stiffness": 0.1, "rest": 0.2})
    before = fit_of(MODEL.with_effects(present))
    spring = start(before.model, Effect("spring_to_ground", "stage1_motor", {"stiffness": 0.1, "rest": 0.2}))
    assert with_shadows([spring], before, pulled, {}) == [spring]
    torque = start(before.model, Effect("constant_torque", "stage1_arm", {"torque": 0.02}))
    found = with_shadows([torque], before, pulled, within_reach(MODEL))
    names = {(f.model.effects[1].effect, f.model.effects[1].location) for f in found}
    assert names == {("constant_torque", "stage1_arm"), ("constant_torque", "stage1_motor")}  # no gravity


def test_one_that_got_farther_as_a_shadow_casts_its_own(monkeypatch):
    """A spring found the joint's preload from where gravity had ended without it: gravity has it, too."""

    def cast(one, other, before, records, limits):
        end = 110.0 if other.effect == "spring_to_ground" else one.log_likelihood
        return fit_of(MODEL.with_effects(other), end)

    monkeypatch.setattr(shadows_module, "_from_there", cast)
    weight = {"torque": 0.1, "phase": 0.1}
    gravity = fit_of(MODEL.with_effects(Effect("gravity", "stage1_arm", weight)), 100.0)
    spring = {"stiffness": 0.1, "rest": -0.1}
    short = fit_of(MODEL.with_effects(Effect("spring_to_ground", "stage1_arm", spring)), 95.0)
    found = with_shadows([gravity, short], fit_of(), [], {})
    ends = {(f.model.effects[0].effect, f.model.effects[0].location): f.log_likelihood for f in found}
    assert ends["spring_to_ground", "stage1_arm"] == ends["gravity", "stage1_arm"] == 110.0


@pytest.mark.parametrize("torque", [0.03, -0.03])
def test_gravity_high_up_is_the_constant_torque_it_stands_for(torque):
    found = shadows(Effect("constant_torque", "stage1_arm", {"torque": torque}))
    gravity = next(e for e in found if e.effect == "gravity")
    p = gravity.parameters
    # -T sin(q + phase) at q = 0, the contract's equation.
    assert -p["torque"] * math.sin(p["phase"]) == pytest.approx(torque)
    assert p["torque"] > 0.0
    assert _at_rest(gravity) == pytest.approx(torque)
    assert _at_rest(Effect("spring_to_ground", "stage1_arm", {"stiffness": 0.1, "rest": 0.3})) == 0.03


def test_the_contact_of_dry_friction_is_held_for_a_trial_and_free_at_the_end():
    friction = Effect("coulomb_friction", "stage1_motor", {"torque": 0.1, "contact_angle": 2e-5})
    name = "stage1_motor.coulomb_friction.contact_angle"
    model = MODEL.with_effects(friction)
    assert name in model.free_parameters()
    held = replace(model, fixed=(*model.fixed, name))
    record = joint_record(5, seconds=3.0)
    fit = replace(fit_from_scratch(MODEL, [record]), model=held, free=held.free_parameters())
    freed = with_contact(fit)
    assert name in freed.free
    assert freed.model.fixed == MODEL.fixed
    assert with_contact(freed) is freed
    scales = recording_scales(MODEL, [record])
    assert within_reach(MODEL, scales)[name] == scales.contacts(0)
    assert name not in within_reach(MODEL)
    ended = polish(freed, [record], {**within_reach(MODEL), name: (1e-5, 3e-5)})
    assert 1e-5 <= ended.model.parameter_values()[name] <= 3e-5
    assert np.isfinite(ended.log_likelihood)


def test_friction_may_be_several_times_the_torque_that_the_joint_carries():
    # Gears that lock themselves: a coefficient of 4 ended at a bound of 1, and what was left had no name.
    model = MODEL.with_effects(Effect("load_dependent_friction", "stage1_motor", {"coefficient": 4.0}))
    name = "stage1_motor.load_dependent_friction.coefficient"
    low, high = bounds(model, (name,), within_reach(MODEL))
    assert low[0] == 0.0
    assert high[0] > 10.0
