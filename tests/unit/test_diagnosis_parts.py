"""The parts of the diagnosis, each by itself: candidates, sizes, choice, and what a left-over torque depends
on."""

import math
from dataclasses import replace

import numpy as np
import pytest
from diagnosis_rigs import DT, MODEL, RIGID, coupled, fit_of, joint_record
from plants import FLEXIBLE

from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.diagnosis.evidence.residual import conditions, intervals
from haptic_teleop_sysid.diagnosis.hypotheses.candidates import candidates, larger_starts
from haptic_teleop_sysid.diagnosis.hypotheses.material import material
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales, within_reach

#: The contract's vocabulary: where each effect may sit in a flexible joint.
BODIES, ENCODERS = ("motor", "arm"), ("motor_encoder", "arm_encoder")
VOCABULARY = {
    "coulomb_friction": BODIES,
    "stribeck_friction": BODIES,
    "asymmetric_friction": BODIES,
    "presliding_friction": BODIES,
    "quadratic_drag": BODIES,
    "position_dependent_friction": BODIES,
    "friction_drift": BODIES,
    "load_dependent_friction": ("motor",),
    "gravity": ("arm",),
    "spring_to_ground": BODIES,
    "constant_torque": BODIES,
    "torque_ripple": ("motor",),
    "backlash": ("joint",),
    "hardening_spring": ("joint",),
    "hysteresis": ("joint",),
    "joint_damping": ("joint",),
    "input_delay": ("actuator",),
    "actuator_lag": ("actuator",),
    "torque_saturation": ("actuator",),
    "dead_zone": ("actuator",),
    "gain_error": ("actuator",),
    "gain_drift": ("actuator",),
    "inertial_coupling": ("arm",),
    "extra_flexible_mode": ("arm",),
    "payload_change": ("arm",),
    "angle_dependent_inertia": ("arm",),
    "torque_speed_limit": ("actuator",),
    "hard_stop": BODIES,
    "encoder_eccentricity": ENCODERS,
    "encoder_scale": ENCODERS,
    "sensor_delay": ENCODERS,
    "channel_skew": (*ENCODERS, "actuator"),
}


@pytest.fixture(scope="module")
def clean():
    return [joint_record(1), joint_record(2, rms=0.35)]


@pytest.fixture(scope="module")
def scales(clean):
    return recording_scales(MODEL, clean[:1])


# candidates


def test_every_effect_of_the_vocabulary_is_tried_everywhere_in_a_flexible_joint(clean, scales):
    found = {(e.effect, e.location) for e in candidates(MODEL, [coupled(clean[0])], scales)}
    assert {(n, f"stage1_{place}") for n, places in VOCABULARY.items() for place in places} <= found
    searched = {n for n, entry in EFFECTS.items() if not (entry.nuisance or entry.tabulated)}
    assert {n for n, _ in found} == searched


def test_a_rigid_body_is_offered_only_what_it_can_have(clean, scales):
    found = {(e.effect, e.location) for e in candidates(RIGID, [coupled(clean[0])], scales)}
    assert {place for _, place in found} == {"j_motor", "j_actuator", "j_motor_encoder"}
    of_a_joint_or_an_arm = {
        "backlash",
        "hardening_spring",
        "hysteresis",
        "joint_damping",
        "load_dependent_friction",
        "inertial_coupling",
        "extra_flexible_mode",
    }
    named = {n for n, _ in found if not EFFECTS[n].unnamed}
    assert named == set(VOCABULARY) - of_a_joint_or_an_arm
    assert ("gravity", "j_motor") in found
    assert ("payload_change", "j_motor") in found


def test_every_candidate_can_be_put_into_the_model(clean, scales):
    for effect in candidates(MODEL, [coupled(clean[0])], scales):
        assert MODEL.with_effects(effect).effects == (effect,)


def test_coupling_needs_a_recording_of_the_other_arm(clean, scales):
    assert "inertial_coupling" not in {e.effect for e in candidates(MODEL, clean, scales)}


def test_a_gain_error_is_not_tried_where_the_torque_constant_is_estimated(clean, scales):
    free = Model("sfj", "stage1", "flexible_joint", FLEXIBLE, fixed=("stiffness",))
    assert "gain_error" not in {e.effect for e in candidates(free, clean, scales)}


def test_a_second_form_of_friction_is_not_tried_beside_the_first(clean, scales):
    model = MODEL.with_effects(Effect("coulomb_friction", "stage1_motor", {"torque": 0.1}))
    found = {(e.effect, e.location) for e in candidates(model, clean, scales)}
    assert ("stribeck_friction", "stage1_motor") not in found
    assert ("coulomb_friction", "stage1_motor") not in found
    assert ("coulomb_friction", "stage1_arm") in found
    assert ("quadratic_drag", "stage1_motor") in found


def test_larger_starts_reach_the_sizes_that_a_small_one_cannot_see(scales):
    small = Effect("backlash", "stage1_joint", {"width": 1e-4 * scales.size["deflection"]})
    widths = [e.parameters["width"] for e in larger_starts(small, scales)]
    assert len(widths) >= 2
    assert max(widths) > 0.1 * scales.size["deflection"]
    assert min(widths) > small.parameters["width"]


def test_larger_starts_keep_the_sign(scales):
    late = [
        e.parameters["delay"]
        for e in larger_starts(Effect("channel_skew", "stage1_actuator", {"delay": 0.001}), scales)
    ]
    early = [
        e.parameters["delay"]
        for e in larger_starts(Effect("channel_skew", "stage1_actuator", {"delay": -0.001}), scales)
    ]
    assert late and min(late) > 0.0
    assert early and max(early) < 0.0


def test_larger_starts_leave_alone_what_is_linear(scales):
    assert larger_starts(Effect("joint_damping", "stage1_joint", {"coefficient": 0.1}), scales) == []


# sizes


@pytest.mark.parametrize(
    ("effect", "place", "parameters", "expected"),
    [
        ("coulomb_friction", "motor", {"torque": 0.1}, True),
        ("coulomb_friction", "motor", {"torque": 2e-5}, False),
        ("stribeck_friction", "motor", {"coulomb": 0.2, "breakaway": 0.3, "velocity": 0.1}, True),
        ("stribeck_friction", "motor", {"coulomb": 0.2, "breakaway": 0.22, "velocity": 0.1}, False),
        ("stribeck_friction", "motor", {"coulomb": 0.2, "breakaway": 0.3, "velocity": 1e-6}, False),
        ("asymmetric_friction", "motor", {"positive": 0.1, "negative": 0.3}, True),
        ("asymmetric_friction", "motor", {"positive": 0.2, "negative": 0.21}, False),
        ("asymmetric_friction", "motor", {"positive": 0.25, "negative": 0.2}, True),
        ("asymmetric_friction", "motor", {"positive": 0.2, "negative": 0.23}, False),
        ("presliding_friction", "motor", {"torque": 0.2, "stiffness": 10.0}, True),
        ("presliding_friction", "motor", {"torque": 0.2, "stiffness": 1000.0}, False),
        ("torque_ripple", "motor", {"amplitude": 0.2, "order": 10.0}, True),
        ("torque_ripple", "motor", {"amplitude": 2e-5, "order": 10.0}, False),
        ("torque_ripple", "motor", {"amplitude": 0.2, "order": 0.1}, False),
        # Half a cycle is a hill, which gravity makes as well.
        ("torque_ripple", "motor", {"amplitude": 0.2, "order": 2.0}, False),
        ("position_dependent_friction", "arm", {"torque": 0.1, "amplitude": 0.1, "order": 9.0}, True),
        ("position_dependent_friction", "arm", {"torque": 0.1, "amplitude": 0.01, "order": 9.0}, False),
        ("input_delay", "actuator", {"delay": 0.004}, True),
        ("input_delay", "actuator", {"delay": 0.000001}, False),
        ("channel_skew", "arm_encoder", {"delay": -0.004}, True),
        ("actuator_lag", "actuator", {"time_constant": 0.02}, True),
        ("backlash", "joint", {"width": 0.01}, True),
        ("backlash", "joint", {"width": 2e-7}, False),
        ("encoder_scale", "arm_encoder", {"scale": 1.01}, True),
        ("encoder_scale", "arm_encoder", {"scale": 1.00001}, False),
        ("torque_saturation", "actuator", {"limit": 2.0}, True),
        ("torque_saturation", "actuator", {"limit": 100.0}, False),
        ("payload_change", "arm", {"time": 4.0, "inertia": 0.05}, True),
        ("payload_change", "arm", {"time": 4.0, "inertia": 1e-6}, False),
        ("payload_change", "arm", {"time": 0.01, "inertia": 0.05}, False),
        ("hard_stop", "arm", {"angle": 0.05, "stiffness": 10.0}, True),
        ("hard_stop", "arm", {"angle": 3.0, "stiffness": 10.0}, False),
        ("extra_flexible_mode", "arm", {"frequency": 12.0, "inertia": 0.01}, True),
        ("extra_flexible_mode", "arm", {"frequency": 200.0, "inertia": 0.01}, False),
        ("extra_flexible_mode", "arm", {"frequency": 12.0, "inertia": 0.01, "damping_ratio": 1.1}, False),
        # An error by a third of the angle and more is none of an encoder.
        ("encoder_eccentricity", "motor_encoder", {"amplitude": 0.01, "order": 20.0}, True),
        ("encoder_eccentricity", "motor_encoder", {"amplitude": 0.02, "order": 20.0}, False),
        ("friction_drift", "motor", {"change": 0.3, "time_constant": 3.0}, True),
        ("friction_drift", "motor", {"change": 0.001, "time_constant": 3.0}, False),
        ("gain_drift", "actuator", {"change": 0.3, "time_constant": 3.0}, True),
        ("gain_drift", "actuator", {"change": 0.3, "time_constant": 0.05}, False),
        ("hard_stop", "arm", {"angle": 0.05, "stiffness": 0.01}, False),
        # The torque pushes into it by four tenths of the travel: a soft spring that begins somewhere.
        ("hard_stop", "arm", {"angle": 0.05, "stiffness": 2.9}, False),
    ],
)
def test_only_sizes_that_matter_bear_a_name(scales, effect, place, parameters, expected):
    assert material(Effect(effect, f"stage1_{place}", parameters), scales) is expected


@pytest.mark.parametrize(
    ("effect", "place", "sized"),
    [
        ("backlash", "joint", lambda on, times: {"width": 0.1 * on.coarsest * times}),
        ("angle_dependent_inertia", "arm", lambda on, times: {"amplitude": 0.001 * times, "order": 11.0}),
        ("torque_ripple", "motor", lambda on, times: {"amplitude": 0.2, "order": 3.77 / on.span * times}),
        (
            "extra_flexible_mode",
            "arm",
            lambda on, times: {"frequency": 12.0, "inertia": 0.8 * on.size["inertia"] / times},
        ),
    ],
)
def test_a_name_begins_at_its_bound(scales, effect, place, sized):
    """A tenth of an encoder's step, a thousandth of the inertia, six tenths of a cycle; and an added part is
    less than four fifths of the arm."""
    location = f"stage1_{place}"
    for times, expected in ((1.1, True), (0.9, False)):
        assert material(Effect(effect, location, sized(scales.at(location), times)), scales) is expected


@pytest.mark.parametrize(("share", "expected"), [(3.0, True), (-0.9, True), (-1.1, False)])
def test_a_spring_that_turns_back_within_the_recording_is_no_softening_one(scales, share, expected):
    bent = scales.size["deflection"]
    straight = scales.size["stiffness"]
    # The spring's own stiffness, of which a sine sees this much.
    own = straight / (1.0 + 0.25 * min(share, 0.0))
    cubic = share * own / (3.0 * bent**2)
    assert material(Effect("hardening_spring", "stage1_joint", {"cubic": cubic}), scales) is expected


def test_starts_lie_within_the_effects_bounds_however_large_the_recording():
    degrees = joint_record(2, seconds=2.0)
    degrees = replace(degrees, measured=57.3 * degrees.measured)
    scales = recording_scales(MODEL, [degrees])
    for effect in candidates(MODEL, [coupled(degrees)], scales):
        for start in (effect, *larger_starts(effect, scales)):
            for name, value in start.parameters.items():
                parameter = start.entry.parameter(name)
                assert parameter.minimum <= value <= parameter.maximum, (start.effect, name)


# what is left over


def test_a_torque_that_follows_the_motor_angle_is_found_on_recordings_not_used_for_the_curve():
    amplitude = 0.6

    def planted(angle):
        return -amplitude * math.sin(6.0 * angle)

    made = [joint_record(3, motor_torque=planted), joint_record(4, rms=0.3, motor_torque=planted)]
    found = conditions(fit_of(), made[:1], made[1:], "stage1")
    best = found[0]
    assert (best.equation, best.name, best.unit) == ("stage1_motor", "motor angle", "rad")
    assert best.explained > 0.8
    expected = -amplitude * np.sin(6.0 * best.centre)
    assert float(np.sqrt(np.mean((best.torque - expected)[2:-2] ** 2))) < 0.2 * amplitude
    assert [c.explained for c in found] == sorted((c.explained for c in found), reverse=True)


def test_noise_alone_follows_nothing(clean):
    assert conditions(fit_of(), clean[:1], clean[1:], "stage1")[0].explained < 0.25


def test_the_stretch_in_which_the_arm_met_a_stop_is_found():
    stiffness, angle, window = 40.0, 0.6, (4.0, 5.5)
    quiet = joint_record(5, rms=0.1)
    assert np.max(np.abs(quiet.measured[:, 1])) < angle

    def stop(q):
        return -stiffness * (q - angle) if q > angle else -stiffness * (q + angle) if q < -angle else 0.0

    record = joint_record(5, rms=0.1, arm_torque=stop, window=window)
    touching = DT * np.flatnonzero(np.abs(record.measured[:, 1]) > angle)
    assert len(touching) > 50
    sizes = {"angle": angle, "stiffness": stiffness, "both_sides": 1.0}
    stopped = MODEL.with_effects(Effect("hard_stop", "stage1_arm", sizes))
    found = intervals(fit_of(), fit_of(stopped), record)
    assert found
    assert all(start > touching[0] - 0.5 and end < touching[-1] + 1.0 for start, end in found)
    assert any(start <= t <= end for start, end in found for t in touching)


def test_models_that_are_the_same_differ_at_no_time(clean):
    assert intervals(fit_of(), fit_of(), clean[0]) == []


def test_a_machine_is_sought_near_what_its_owner_believes():
    limits = within_reach(MODEL)
    for name, value in MODEL.parameters.items():
        low, high = limits[name]
        assert low < value < high or value == 0.0
        assert high > low
    assert limits["torque_constant"][0] > 0.05 * MODEL.parameters["torque_constant"]
