"""A law that only comes near to the joint's is told from the joint's own: a magnetic coupling whose pull is
a sine of the deflection from a spring that softens with its cube, a brake beyond its peak from dry friction.
The joints are integrated here by Runge and Kutta; no equation of the simulation takes part."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from identification_plants import STAGE, multisine
from numba import njit

from haptic_teleop_sim.effects.torque_map import TorqueMap
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision.name_tests.law import by_its_law
from haptic_teleop_sysid.diagnosis.decision.search.decide import Choice
from haptic_teleop_sysid.diagnosis.decision.search.rounds import SearchResult
from haptic_teleop_sysid.diagnosis.evidence.lack_of_fit import lack_of_fit
from haptic_teleop_sysid.diagnosis.hypotheses.explanation import Explanation
from haptic_teleop_sysid.diagnosis.hypotheses.follows import own_variable
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.whole_fit import fit_whole, noise_starts

DT, SECONDS, FINE = 0.002, 16.0, 20
STEP = 1e-5
"""rad per step of the encoders."""
CUBE, SINE, BRAKE, RUBS = 0, 1, 2, 3
SPRING = Effect("hardening_spring", "stage1_joint", {"cubic": -5.0})
FRICTION = Effect("coulomb_friction", "stage1_motor", {"torque": 0.2})


@njit
def _rates(x, drive, p, law):
    k, jm, bm, ja, ba = p
    deflection = x[0] - x[1]
    spring, motor = k * deflection, drive - bm * x[2]
    if law == 0:
        spring -= 6.0 * deflection**3
    elif law == 1:
        spring = k * math.sin(3.0 * deflection) / 3.0
    elif law == 2:
        motor -= 1.0 * (x[2] / 0.3) / (1.0 + (x[2] / 0.3) ** 2)
    else:
        motor -= 0.3 * math.tanh(x[2] / 0.002)
    return np.array([x[2], x[3], (motor - spring) / jm, (spring - ba * x[3]) / ja])


@njit
def _run(drive, p, law, fine, step):
    x, angles = np.zeros(4), np.empty((len(drive), 2))
    for i in range(len(drive)):
        angles[i] = x[:2]
        for _ in range(fine):
            a = _rates(x, drive[i], p, law)
            b = _rates(x + 0.5 * step * a, drive[i], p, law)
            c = _rates(x + 0.5 * step * b, drive[i], p, law)
            d = _rates(x + step * c, drive[i], p, law)
            x = x + step * (a + 2.0 * b + 2.0 * c + d) / 6.0
    return angles


def recorded(law, seed, changed=()):
    """``changed``: factors of parameters."""
    names = ("stiffness", "motor_inertia", "motor_damping", "arm_inertia", "arm_damping")
    factors = dict(changed)
    p = np.array([STAGE.parameters[n] * factors.get(n, 1.0) for n in names])
    constant = STAGE.parameters["torque_constant"]
    n = round(SECONDS / DT)
    current = multisine(n, DT, 0.25, (0.2, 5.0), seed)
    random = np.random.default_rng(seed)
    fine = 4 * FINE if law == RUBS else FINE
    angles = _run(constant * current + 0.02 * random.standard_normal(n), p, law, fine, DT / fine)
    read = STEP * np.round(angles / STEP)
    return Record("joint", DT, current, read, np.zeros(n), (STEP, STEP), at_rest=True)


def fitted(law, effect):
    """Both recordings, and the fits of structure and named effect to the first one."""
    here, there = recorded(law, 1), recorded(law, 2)
    bare = fit_whole(STAGE, noise_starts(STAGE, [here])[0], [here])
    return here, there, bare, fit_whole(bare.model.with_effects(effect), bare.noise, [here])


def result(bare, named, **of_explanation):
    gain = named.log_likelihood - bare.log_likelihood
    chosen = Explanation(named, gain, gain, True, 0, **of_explanation)
    scales = SimpleNamespace(size={"torque": 1.0})
    return SearchResult(bare, named, (Choice(chosen, 1.0),), (), scales)


@pytest.fixture(scope="module", params=[(CUBE, SPRING), (RUBS, FRICTION)], ids=["spring", "friction"])
def right(request):
    return fitted(*request.param)


@pytest.fixture(scope="module", params=[(SINE, SPRING), (BRAKE, FRICTION)], ids=["coupling", "brake"])
def wrong(request):
    return fitted(*request.param)


def test_a_right_name_stays_as_it_was(right):
    here, there, bare, named = right
    before = result(bare, named)
    after, doubt, followed = by_its_law(before, [here], [there])
    assert (after, doubt, followed) == (before, None, None)


def test_nobody_is_sure_of_a_cubic_spring_for_a_sine():
    here, there, bare, named = fitted(SINE, SPRING)
    after, doubt, _ = by_its_law(result(bare, named), [here], [there])
    assert "not quite" in after.choices[0].unsure and doubt is None


@pytest.mark.parametrize(
    "changed", [{"stiffness": 1.02}, {"arm_inertia": 1.05}, {"motor_damping": 1.3}, {"motor_inertia": 1.05}]
)
def test_a_machine_that_has_changed_between_recordings_keeps_its_right_name(right, changed):
    here, _, bare, named = right
    law = CUBE if named.model.effects[0].effect == SPRING.effect else RUBS
    after, doubt, followed = by_its_law(result(bare, named), [here], [recorded(law, 2, changed)])
    assert not after.choices[0].unsure and (doubt, followed) == (None, None)


def test_dry_friction_gives_way_to_a_brake_beyond_its_peak():
    here, there, bare, named = fitted(BRAKE, FRICTION)
    after, doubt, followed = by_its_law(result(bare, named), [here], [there])
    assert not after.choices and after.final is bare and followed is None
    assert doubt is not None and "motor velocity" in doubt.why
    assert [one.found.effect.effect for one in after.given_up] == ["coulomb_friction"]


def test_what_others_named_beside_it_stays_and_the_rest_is_unknown():
    here, there, bare, named = fitted(BRAKE, FRICTION)
    softer = replace(SPRING, parameters={"cubic": 0.1})
    both = fit_whole(named.model.with_effects(softer), named.noise, [here])
    first = result(bare, both)
    second = Choice(replace(first.choices[0].chosen, effect_index=1), 1.0)
    after, doubt, followed = by_its_law(replace(first, choices=(*first.choices, second)), [here], [there])
    assert [c.chosen.effect.effect for c in after.choices] == ["hardening_spring"] and doubt is None
    assert followed == ("stage1_motor", "motor velocity")


def test_what_a_curve_gains_is_no_more_than_a_fit_with_it():
    """The score test goes one step, with noise levels that make up for what is missing: here of the fifth
    power, which is what the cube lacks of a sine, drawn as a map beside the name."""
    here, _, _, named = fitted(SINE, SPRING)
    gain = lack_of_fit([(named, [here])], SPRING)
    deflection = here.measured[:, 0] - here.measured[:, 1]
    knots = tuple(np.linspace(*np.quantile(deflection, (0.005, 0.995)), 9).tolist())
    torque = tuple(81.0 / 120.0 * STAGE.parameters["stiffness"] * k**5 for k in knots)
    drawn = Effect("torque_map", "stage1_joint", table=TorqueMap(("deflection",), (knots,), torque))
    again = fit_whole(named.model.with_effects(drawn), named.noise, [here], free=named.free)
    assert gain is not None and 12.0 < gain < again.log_likelihood - named.log_likelihood


@pytest.mark.parametrize(
    ("effect", "own"),
    [
        (SPRING, ("deflection", "joint")),
        (FRICTION, ("velocity", "motor")),
        (Effect("joint_damping", "stage1_joint", {"coefficient": 0.1}), ("deflection_rate", "joint")),
        (Effect("gravity", "stage1_arm", {"torque": 0.1, "phase": 0.0}), ("angle", "arm")),
        (Effect("hard_stop", "stage1_arm", {"angle": -0.9, "stiffness": 100.0}), ("angle", "arm")),
        (Effect("hard_stop", "stage1_arm", {"angle": 1.5, "stiffness": 100.0}), ("angle", "arm")),
        (Effect("dead_zone", "stage1_actuator", {"width": 0.1}), ("input", "motor")),
        (Effect("actuator_lag", "stage1_actuator", {"time_constant": 0.01}), ("input", "motor")),
        (Effect("sensor_delay", "stage1_arm_encoder", {"delay": 0.01}), None),
        (Effect("gain_drift", "stage1_actuator", {"change": 0.1, "time_constant": 5.0}), None),
        (Effect("constant_torque", "stage1_motor", {"torque": 0.1}), None),  # over nothing
        (
            Effect(
                "position_dependent_friction",
                "stage1_motor",
                {"torque": 0.1, "amplitude": 0.05, "order": 1.0, "phase": 0.0},
            ),
            None,  # over the angle and the direction
        ),
        (Effect("load_dependent_friction", "stage1_motor", {"coefficient": 0.1}), None),
    ],
)
def test_the_quantity_of_a_law(effect, own):
    assert own_variable(STAGE.with_effects(effect), effect) == own


def test_what_currents_or_the_second_method_show_is_not_asked(wrong):
    here, there, bare, named = wrong
    for shown in ({"by_current": 5.0}, {"grounds": "it explains 90 %"}):
        before = result(bare, named, **shown)
        assert by_its_law(before, [here], [there]) == (before, None, None)


def test_an_input_that_never_moves_says_nothing():
    here, _, _, named = fitted(SINE, SPRING)
    still = replace(here, input=np.zeros(len(here)), measured=np.zeros((len(here), 2)))
    assert lack_of_fit([(named, [still])], SPRING) is None
