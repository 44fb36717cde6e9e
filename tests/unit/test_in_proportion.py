"""What a share of the input is, is told from what the motion makes: an amplifier that loses commands from a
bearing that rubs at times. The joint is stepped by the matrix exponential."""

from dataclasses import replace

import numpy as np
import pytest
from identification_plants import STAGE, multisine
from scipy.linalg import expm

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision.unknown.at_the_actuator import (
    WITH_THE_INPUT,
    at_the_actuator,
    drawn_over_the_input,
)
from haptic_teleop_sysid.diagnosis.decision.verdict import Verdict
from haptic_teleop_sysid.diagnosis.evidence.feedback import answered_share, answers
from haptic_teleop_sysid.diagnosis.evidence.in_proportion import (
    ACCELERATION,
    INPUT,
    in_proportion,
    with_the_input,
)
from haptic_teleop_sysid.diagnosis.evidence.measured_map import MeasuredMap
from haptic_teleop_sysid.estimation.likelihood import innovations
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.whole_fit import fit_whole, noise_starts

DT, SECONDS = 0.002, 16.0
STEP = 1e-5
"""rad per step of the encoders."""
CUTOFF = 8.0
"""Hz, of the equations of motion."""


def stretches(seed, share=0.15):
    """Which samples (n,) are in one of some stretches of 0.1 to 0.4 s."""
    random, found = np.random.default_rng(seed), np.zeros(round(SECONDS / DT), dtype=bool)
    while found.mean() < share:
        start = random.integers(len(found))
        found[start : start + random.integers(50, 200)] = True
    return found


def record(seed, missing, feedback=0.0, jumps=False):
    """A joint that ``missing`` (input A, motor speed, number of the sample) -> N·m takes torque from, driven
    by a multisine, or with ``feedback`` by a controller of that bandwidth, Hz, that follows one; ``jumps``:
    the sign of one."""
    p = STAGE.parameters
    k, jm, ja = p["stiffness"], p["motor_inertia"], p["arm_inertia"]
    bm, ba = p["motor_damping"], p["arm_damping"]
    a, b = np.zeros((4, 4)), np.array([[0.0], [0.0], [1.0 / jm], [0.0]])
    a[:2, 2:], a[2] = np.eye(2), [-k / jm, k / jm, -bm / jm, 0.0]
    a[3] = [k / ja, -k / ja, 0.0, -ba / ja]
    step = expm(DT * np.block([[a, b], [np.zeros((1, 5))]]))
    n = round(SECONDS / DT)
    wanted, current = multisine(n, DT, 0.15, (0.2, 5.0), seed), np.zeros(n)
    random = np.random.default_rng(seed)
    wanted = 0.2 * np.sign(wanted) if jumps else wanted
    wide = 2.0 * np.pi * feedback
    x, angles, speed = np.zeros(4), np.empty((n, 2)), 0.0
    for i in range(n):
        angles[i] = STEP * np.round(x[:2] / STEP)
        current[i] = wanted[i]
        if feedback:
            speed += 0.5 * ((angles[i, 0] - angles[max(i - 1, 0), 0]) / DT - speed)
            wants = wide**2 * (wanted[i] - angles[i, 0]) - 1.4 * wide * speed
            current[i] = (jm + ja) * wants / p["torque_constant"]
        torque = p["torque_constant"] * current[i] + 0.01 * random.standard_normal()
        x = step[:4, :4] @ x + step[:4, 4] * (torque - missing(current[i], x[2], i))
    return Record("joint", DT, current, angles, np.zeros(n), (STEP, STEP), at_rest=True)


def fitted(one):
    return fit_whole(STAGE, noise_starts(STAGE, [one])[0], [one])


def gained(fit, one):
    return in_proportion([(fit, [one])], fit.free)


def innovated(one):
    fit = fitted(one)
    return one, innovations(pack(fit.model), fit.noise, one).innovation


def lost(seed, feedback=0.0):
    """Half of the command is lost at times."""
    at, constant = stretches(seed), STAGE.parameters["torque_constant"]
    return record(seed, lambda current, speed, i: 0.5 * constant * current * at[i], feedback)


def pushed(seed):
    """Somebody pushes at times while a controller follows its reference."""
    at, random = stretches(seed, 0.3), np.random.default_rng(100 + seed)
    frequency = np.fft.rfftfreq(len(at), DT)
    spectrum = np.fft.rfft(random.standard_normal(len(at))) * ((frequency > 0.5) & (frequency < 6.0))
    push = np.fft.irfft(spectrum, len(at))
    push *= 1.5 / np.std(push)
    return record(seed, lambda current, speed, i: push[i] * at[i], feedback=6.0)


def rubs(seed):
    """Something rubs at times."""
    at = stretches(seed)
    return record(seed, lambda current, speed, i: 0.15 * np.sign(speed) * at[i])


@pytest.fixture(scope="module")
def losing():
    here, elsewhere = lost(1), lost(2)
    return here, elsewhere, fitted(here)


@pytest.fixture(scope="module")
def rubbing():
    here, elsewhere = rubs(3), rubs(4)
    return here, elsewhere, fitted(here)


def unknown_at(place):
    where = {"equation": place, "share": 1.0, "condition": "time", "intervals": []}
    return Verdict("unknown", [where], [], [], [])


def test_commands_lost_at_times_are_a_share_of_the_input(losing):
    here, _, fit = losing
    gains = gained(fit, here)
    assert next(iter(gains)) == INPUT
    assert with_the_input(gains)


@pytest.mark.parametrize("seed", [1, 11, 21, 31, 41])
def test_who_pushes_in_a_closed_loop_is_no_share_of_the_input(seed):
    """A controller's output is nearly in proportion to what pushes the joint."""
    here, elsewhere = pushed(seed), pushed(seed + 1)
    before = unknown_at("stage1_motor")
    found, gains = at_the_actuator(before, fitted(here), [here], [elsewhere], CUTOFF)
    assert found is before and gains


@pytest.mark.parametrize("seed", [3, 5, 7, 11])
def test_commands_that_a_controller_loses_are_the_actuators(seed):
    here, elsewhere = lost(seed, feedback=6.0), lost(seed + 1, feedback=6.0)
    found, gains = at_the_actuator(unknown_at("stage1_motor"), fitted(here), [here], [elsewhere], CUTOFF)
    assert found.where[0]["equation"] == "stage1_actuator"
    assert next(iter(gains)) == INPUT


@pytest.mark.parametrize(("motion", "told"), [(20.0, True), (24.0, True), (26.0, False), (31.0, False)])
def test_the_input_must_gain_more_than_any_motion_beyond_doubt(motion, told):
    assert with_the_input({INPUT: 30.0, "motor velocity": motion}) is told


@pytest.mark.parametrize(
    ("share", "rigid", "told"), [(90.0, True, True), (120.0, True, False), (90.0, False, False)]
)
def test_the_acceleration_of_a_rigid_joint_is_nearly_its_input(share, rigid, told):
    """An inertia that changes takes a share of it."""
    gains = {INPUT: 90.0, ACCELERATION: share, "motor velocity": 5.0}
    assert with_the_input(gains, rigid) is told


@pytest.mark.parametrize(("feedback", "place"), [(0.0, "stage1_actuator"), (6.0, "stage1_motor")])
def test_what_follows_the_input_that_no_controller_made_is_the_actuators(losing, feedback, place):
    here, _, fit = losing
    before = unknown_at("stage1_motor")
    follows = replace(before, where=[{**before.where[0], "condition": "input torque"}])
    still = record(5, lambda current, speed, i: 0.0, feedback)  # nothing is in proportion to anything
    found, _ = at_the_actuator(follows, fitted(still), [still], [still], CUTOFF)
    assert found.where[0] == {**follows.where[0], "equation": place}


@pytest.mark.parametrize("made", [lost, rubs])
def test_a_signal_that_was_made_before_answers_nothing(made):
    assert answered_share(*innovated(made(1))) < 0.05


@pytest.mark.parametrize("bandwidth", [2.0, 10.0])
def test_a_controllers_output_answers_to_the_innovations(bandwidth):
    one = record(1, lambda current, speed, i: 0.0, feedback=bandwidth)
    assert answers(*innovated(one))


def test_a_reference_that_jumps_now_and_then_does_not_hide_it():
    one = record(1, lambda current, speed, i: 0.0, feedback=6.0, jumps=True)
    assert answers(*innovated(one))


def test_a_record_without_input_and_a_short_one_say_nothing(losing):
    here, _, fit = losing
    assert gained(fit, replace(here, input=np.zeros(len(here)))) == {}
    short = {n: getattr(here, n)[:400] for n in ("input", "measured", "exogenous")}
    assert not with_the_input(gained(fit, replace(here, **short)))


def test_an_effect_at_the_actuator_takes_its_share_itself(losing):
    here, elsewhere, fit = losing
    before = unknown_at("stage1_motor")
    named = replace(before, findings=[{"effect": "gain_drift", "location": "stage1_actuator"}])
    late = replace(fit, model=STAGE.with_effects(Effect("input_delay", "stage1_actuator", {"delay": 0.01})))
    assert at_the_actuator(named, fit, [here], [elsewhere], CUTOFF) == (named, None)
    assert at_the_actuator(before, late, [here], [elsewhere], CUTOFF) == (before, None)


def test_readings_that_are_missing_do_not_hide_it(losing):
    here, _, fit = losing
    read = here.measured.copy()
    read[::7, 0] = np.nan
    read[::2, 1] = np.nan
    assert with_the_input(gained(fit, replace(here, measured=read)))


def test_what_rubs_at_times_goes_with_the_direction(rubbing):
    here, _, fit = rubbing
    gains = gained(fit, here)
    assert next(iter(gains)) == "direction of motor velocity"
    assert not with_the_input(gains)


def test_of_nothing_no_quantity_gains_more_than_chance():
    one = record(5, lambda current, speed, i: 0.0)
    gains = gained(fitted(one), one)
    assert max(gains.values()) < 12.0


def test_a_share_that_never_changes_is_the_structures():
    weak = record(6, lambda current, speed, i: 0.3 * STAGE.parameters["torque_constant"] * current)
    assert not with_the_input(gained(fitted(weak), weak))


def test_the_verdict_goes_to_the_actuator(losing):
    here, elsewhere, fit = losing
    found, gains = at_the_actuator(unknown_at("stage1_motor"), fit, [here], [elsewhere], CUTOFF)
    assert found.where[0] | {"equation": "stage1_actuator", "condition": WITH_THE_INPUT} == found.where[0]
    assert next(iter(gains)) == INPUT


def test_what_rubs_stays_at_the_motor(rubbing):
    here, elsewhere, fit = rubbing
    before = unknown_at("stage1_motor")
    found, gains = at_the_actuator(before, fit, [here], [elsewhere], CUTOFF)
    assert found is before
    assert gains


def test_beside_a_structure_that_ended_at_a_bound_nothing_is_asked(losing):
    here, elsewhere, fit = losing
    before = unknown_at("stage1_motor")
    stuck = replace(fit, at_bound=("motor_inertia",))
    assert at_the_actuator(before, stuck, [here], [elsewhere], CUTOFF) == (before, None)
    undamped = replace(fit, model=fit.model.with_values({"arm_damping": 0.0}), at_bound=("arm_damping",))
    assert at_the_actuator(before, undamped, [here], [elsewhere], CUTOFF)[1]
    contact = replace(fit, at_bound=("stage1_motor.coulomb_friction.contact_angle",))
    assert at_the_actuator(before, contact, [here], [elsewhere], CUTOFF)[1]


def test_another_place_and_a_name_are_not_asked(losing):
    here, elsewhere, fit = losing
    at_the_arm, named = unknown_at("stage1_arm"), replace(unknown_at("stage1_motor"), kind="identified")
    for before in (at_the_arm, named):
        assert at_the_actuator(before, fit, [here], [elsewhere], CUTOFF) == (before, None)


@pytest.mark.parametrize(
    ("quantities", "explained", "at_actuator"),
    [
        (("input torque", "motor angle"), 0.95, True),
        (("input torque", "motor angle"), 0.6, False),
        (("input torque",), 0.95, False),  # what rubs is no function of the input, see `over_the_input`
        (("motor angle",), 0.99, False),
    ],
)
def test_what_a_map_over_the_input_and_the_angle_explains_is_the_actuator_s(
    rubbing, quantities, explained, at_actuator
):
    here, there, fit = rubbing
    asked = [here], [there], CUTOFF
    effect = Effect("constant_torque", "stage1_motor", {"torque": 0.1})
    mapped = MeasuredMap("drawn", effect=effect, explained=explained, quantities=quantities)
    found = drawn_over_the_input(unknown_at("stage1_motor"), mapped, fit, *asked)
    told = ("stage1_actuator", " and ".join(quantities)) if at_actuator else ("stage1_motor", "time")
    assert (found.where[0]["equation"], found.where[0]["condition"]) == told
    elsewhere, before = unknown_at("stage1_arm"), unknown_at("stage1_motor")
    without = replace(mapped, effect=None)
    assert drawn_over_the_input(elsewhere, mapped, fit, *asked) == elsewhere
    assert drawn_over_the_input(before, without, fit, *asked) == before
    weaker = Effect("actuator_lag", "stage1_actuator", {"time_constant": 0.01})
    lagging = replace(fit, model=fit.model.with_effects(weaker))
    assert drawn_over_the_input(before, mapped, lagging, *asked) == before
