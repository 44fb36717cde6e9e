"""Dry friction is seen where the motion turns, whatever else acts that has no name."""

from dataclasses import replace

import numpy as np
import pytest
from numba import njit
from stepped_machines import DT, ELASTIC, FINE, RIGID, drive, pendulum, record, two_masses

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision.search.rounds import SearchResult
from haptic_teleop_sysid.diagnosis.decision.unknown.at_reversals import (
    AtReversals,
    Turning,
    where_torque_jumps,
    with_friction,
)
from haptic_teleop_sysid.diagnosis.decision.verdict import Verdict
from haptic_teleop_sysid.diagnosis.evidence.reversals import Jump, jump
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales
from haptic_teleop_sysid.diagnosis.report.inverse_dynamics import at_reversals
from haptic_teleop_sysid.estimation.whole_fit import fit_whole, noise_starts
from haptic_teleop_sysid.recordings.parameter_units import Units

TWO = replace(ELASTIC, fixed=("torque_constant",))


@njit
def wake(torque, coulomb, strength):
    """Angles (n,) of a mass that drags an oscillator about, of which nobody reads anything."""
    q, v, x, w, h = 0.0, 0.0, 0.3, 0.0, DT / FINE
    found = np.empty(len(torque))
    for k in range(len(torque)):
        found[k] = q
        for _ in range(FINE):
            pull = strength * x - coulomb * np.sign(v)
            v += h * (torque[k] - 0.35 * v + pull) / 0.14
            w += h * (9.0 * (1.0 - x * x) * w - 90.0 * x + 20.0 * v)
            x += h * w
            q += h * v
    return found


@njit
def rubbing_motor(torque, coulomb):
    """Angles (n, 2) of two masses with a spring that creeps, dry friction on the first."""
    q, h = np.zeros(5), DT / FINE
    found = np.empty((len(torque), 2))
    for k in range(len(torque)):
        found[k, 0], found[k, 1] = q[0], q[1]
        for _ in range(FINE):
            spring = 20.0 * (q[0] - q[1]) + 15.0 * (q[0] - q[1] - q[4])
            q[2] += h * (torque[k] - 0.3 * q[2] - spring - coulomb * np.sign(q[2])) / 0.06
            q[3] += h * (spring - 0.02 * q[3]) / 0.1
            q[4] += h * 3.0 * (q[0] - q[1] - q[4])
            q[0] += h * q[2]
            q[1] += h * q[3]
    return found


def driven(make, seed, size=2.0):
    torque = drive(seed, size)
    angles = make(torque)
    return record(torque, angles if angles.ndim == 2 else angles[:, None], 1e-5)


def baseline(model, records):
    return fit_whole(model, noise_starts(model, records)[1], records, iterations=3)


@pytest.mark.parametrize("strength", [0.0, 0.25])
def test_friction_is_seen_beside_an_oscillator_that_nobody_reads(strength):
    records = [driven(lambda u: wake(u, 0.2, strength), seed) for seed in (0, 1)]
    for one in records:
        found = jump(RIGID, [one], "motor")
        assert found.size == pytest.approx(0.2, rel=0.25)  # with 2.5 times as much beside it
        assert found.std < 0.02 and found.reversals > 10
        assert found.input == pytest.approx(np.sqrt(np.mean(one.input**2)))
    (seen,) = where_torque_jumps(baseline(RIGID, records[:1]), records[:1], records[1:]).jumps
    assert (seen.effect, seen.location) == ("coulomb_friction", "j_motor")
    assert abs(seen.size - 0.2) < 3.0 * seen.std
    told = at_reversals(seen.content())
    assert told.startswith("Where the motion turns, the torque at j_motor jumps by twice 0.")
    assert "that is coulomb_friction of this size" in told and "N·m" in told


@pytest.mark.parametrize("more", [{"weight": 1.0, "detent": 0.5}, {"swirl": 0.2, "offset": 0.3}])
def test_smooth_physics_makes_no_jump(more):
    records = [pendulum(seed, **more) for seed in (0, 1)]
    found = where_torque_jumps(baseline(RIGID, records[:1]), records[:1], records[1:])
    assert found.jumps == () and found.not_seen("presliding_friction", "j_motor")
    assert not found.not_seen("quadratic_drag", "j_motor"), "which does not jump"


def test_the_spring_tells_at_which_end_it_rubs():
    at_arm = [
        driven(lambda u: two_masses(u, 20.0, (0.06, 0.3), (0.1, 0.02), 0.2), seed) for seed in (3, 4)
    ]
    at_motor = [driven(lambda u: rubbing_motor(u, 0.2), seed) for seed in (3, 4)]
    for location, records in (("j_arm", at_arm), ("j_motor", at_motor)):
        (seen,) = where_torque_jumps(baseline(TWO, records[:1]), records[:1], records[1:]).jumps
        assert seen.location == location
        assert seen.size == pytest.approx(0.2, rel=0.1)


def test_a_jump_on_one_kind_of_recordings_alone_is_none():
    with_it, without = (driven(lambda u, c=c: wake(u, c, 0.3), seed) for seed, c in ((0, 0.2), (1, 0.0)))
    assert where_torque_jumps(baseline(RIGID, [with_it]), [with_it], [without]).jumps == ()


def test_what_the_model_has_already_is_not_asked_for():
    records = [driven(lambda u: wake(u, 0.2, 0.3), seed) for seed in (0, 1)]
    known = RIGID.with_effects(Effect("stribeck_friction", "j_motor", {
        "coulomb": 0.1, "breakaway": 0.2, "velocity": 0.1}))  # fmt: skip
    assert where_torque_jumps(baseline(known, records[:1]), records[:1], records[1:]) == Turning()


def test_few_reversals_and_readings_that_are_missing_there_say_nothing():
    one = driven(lambda u: wake(u, 0.2, 0.3), 0)
    torque = 2.0 * np.sin(2 * np.pi * 0.1 * DT * np.arange(5000))
    once = record(torque, wake(torque, 0.2, 0.0)[:, None], 1e-5)
    assert jump(RIGID, [once], "motor") is None
    still = replace(one, measured=np.zeros_like(one.measured))
    assert jump(RIGID, [still], "motor") is None
    measured = one.measured.copy()
    half = len(measured) // 2
    measured[::7, 0] = np.nan  # holes of one sample, which are bridged
    bridged = jump(RIGID, [replace(one, measured=measured)], "motor")
    assert bridged.reversals == jump(RIGID, [one], "motor").reversals
    measured = one.measured.copy()
    for start in range(0, len(measured), 250):
        measured[start : start + 60, 0] = np.nan  # longer ones, everywhere
    assert jump(RIGID, [replace(one, measured=measured)], "motor") is None
    measured = one.measured.copy()
    measured[half:, 0] = np.nan
    kept = jump(RIGID, [replace(one, measured=measured)], "motor")
    assert 3 <= kept.reversals < jump(RIGID, [one], "motor").reversals


@pytest.mark.parametrize("driven", [5.4, 24.5])
def test_friction_that_is_small_beside_what_drives_one_recording_is_there(driven):
    """It was a tenth of the torque on one kind of recordings, 2 % on the other, and said to be absent."""
    jumps = Jump(0.605, 0.025, 12, 5.4), Jump(0.554, 0.006, 46, driven)
    found = AtReversals("coulomb_friction", "j_motor", jumps)
    assert found.stands and not found.absent
    less = tuple(replace(j, size=0.1 * j.size) for j in jumps)
    assert not AtReversals("coulomb_friction", "j_motor", less).stands


def test_what_is_not_seen_is_absent_only_where_it_would_be_seen():
    sharp, blunt = (Jump(0.001, std, 20, 1.0) for std in (0.004, 0.04))
    for jumps, absent in (((sharp, sharp), True), ((blunt, blunt), False)):
        assert AtReversals("coulomb_friction", "j_motor", jumps).absent == absent
    seen = Jump(0.1, 0.004, 20, 1.0)
    assert not AtReversals("coulomb_friction", "j_motor", (seen, seen)).absent


def told(kind, findings=()):
    return Verdict(kind, [], list(findings), [], [])


def test_friction_that_is_seen_only_there_is_part_of_the_answer_and_nobody_is_sure_of_it():
    records = [driven(lambda u: wake(u, 0.2, 0.25), seed) for seed in (0, 1)]
    fit = baseline(RIGID, records[:1])
    seen = where_torque_jumps(fit, records[:1], records[1:])
    result = SearchResult(fit, fit, (), (), recording_scales(RIGID, records))
    beside = with_friction(told("unknown"), seen, result, records[:1])
    (finding,) = beside.findings
    assert (finding["effect"], finding["location"]) == ("coulomb_friction", "j_motor")
    assert 0.5 < finding["confidence"] <= 0.69
    assert finding["parameters"]["torque"]["value"] == pytest.approx(0.2, rel=0.15)
    assert "where the motion turns" in finding["because"]
    driven_by_current = Units("m", "A").restated_all({**finding, "reversals": [seen.jumps[0].content()]})
    assert "N*m" not in str(driven_by_current) and " A and 0." in driven_by_current["because"]
    # Where nothing was missed before, something is: what, has no name.
    missed = with_friction(told("no_mismatch"), seen, result, records[:1])
    assert missed.kind == "unknown" and missed.where[0]["equation"] == "j_motor"
    # Another form of the same is named: nothing is added.
    named = told("identified", [{"effect": "presliding_friction", "location": "j_motor", "confidence": 0.9}])
    assert with_friction(named, seen, result, records[:1]) == named
    # So it is with what surely jumps there, too, whatever its law; not with what does not, or sits elsewhere.
    for effect, location, confidence, enough in (
        ("load_dependent_friction", "j_motor", 0.9, True),
        ("load_dependent_friction", "j_motor", 0.5, False),
        ("load_dependent_friction", "j_arm", 0.9, False),
        ("quadratic_drag", "j_motor", 0.9, False),
    ):
        named = told("identified", [{"effect": effect, "location": location, "confidence": confidence}])
        assert (with_friction(named, seen, result, records[:1]) == named) is enough
    assert with_friction(told("no_mismatch"), Turning(), result, records[:1]) == told("no_mismatch")


@pytest.mark.parametrize("coulomb", [0.3, 0.0])
def test_where_noise_hides_the_inertia_what_is_known_of_it_tells_the_friction(coulomb):
    """A relay turns the motion with one torque: only noisy accelerations vary there, and drew friction to
    zero; on eight real joints nothing was said for that, and on others it was up to 73 % too small."""
    torque = 3.0 * np.sign(np.sin(2.0 * np.pi * 0.9 * DT * np.arange(8000)))
    noise = 2e-4 * np.random.default_rng(1).standard_normal((len(torque), 1))
    relay = record(torque, wake(torque, coulomb, 0.0)[:, None] + noise, 1e-5)
    known = replace(RIGID, parameters={**RIGID.parameters, "motor_inertia": 0.14})
    found = jump(known, [relay], "motor", (0.14, 0.14))
    assert found.size == pytest.approx(coulomb, abs=0.01)
    assert found.std < 0.01 and found.common == 0.0
    # What is not known of the inertia is not known of the friction: two of three agree on a wrong one.
    for own, others in ((0.14, (0.1, 0.2)), (0.2, (0.2, 0.14)), (0.25, (0.25, 0.14))):
        believed = replace(RIGID, parameters={**RIGID.parameters, "motor_inertia": own})
        unsure = jump(believed, [relay], "motor", others)
        assert abs(unsure.size - coulomb) < 2.5 * unsure.common + 0.01
        seen = AtReversals("coulomb_friction", "j_motor", (unsure, unsure))
        assert seen.std >= unsure.common


def test_noise_hides_the_friction_of_a_joint_that_flexes():
    torque = 3.0 * np.sign(np.sin(2.0 * np.pi * 0.9 * DT * np.arange(8000)))
    angles = two_masses(torque, 20.0, (0.06, 0.3), (0.1, 0.02), 0.3)
    noise = 2e-4 * np.random.default_rng(1).standard_normal(angles.shape)
    assert jump(TWO, [record(torque, angles + noise, 1e-5)], "motor") is None
