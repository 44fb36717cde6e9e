"""A torque over the input: what an amplifier makes of a command that is no torque along the motion."""

from dataclasses import replace

import numpy as np
import pytest
from identification_plants import STAGE
from numba import njit
from stepped_machines import DT, FINE, RIGID, drive, record, swing

from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sysid.diagnosis.evidence.drawn_map import drawn, explained_there
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.band import motion_band
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.latent import INPUT, measured_over
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.motion import banded
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.sampled import linear
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.terms import Hypothesis
from haptic_teleop_sysid.diagnosis.evidence.places_of_maps import filled, places_of
from haptic_teleop_sysid.diagnosis.evidence.suggested_law import of_map
from haptic_teleop_sysid.diagnosis.evidence.suggested_law.library import (
    Product,
    angle_functions,
    gained_functions,
)
from haptic_teleop_sysid.diagnosis.evidence.suggested_law.of_map import law_of
from haptic_teleop_sysid.diagnosis.hypotheses.follows import follows_from_motion
from haptic_teleop_sysid.estimation.whole_fit import fit_whole, noise_starts

TRUE = RIGID.with_values({"motor_inertia": 0.14, "motor_damping": 0.35})


def made_of(acts, seed, coulomb=0.0, one_way=False):
    """A recording of a joint on which ``acts``(command) acts; ``one_way``: the command has one sign."""
    torque = np.abs(drive(seed, 2.0)) if one_way else drive(seed, 2.0)
    return [record(torque, swing(acts(torque), 0.14, 0.35, coulomb, 0.0, 0.0, 0.0, 0.0)[:, None], 1e-5)]


def drawn_over_input(acts, coulomb=0.0, one_way=False):
    """The search and the maps of such a joint, best first."""
    learn, judge = (made_of(acts, seed, coulomb, one_way) for seed in (0, 1))
    fit = fit_whole(TRUE, noise_starts(TRUE, learn)[1], learn, iterations=8)
    (place,) = places_of(fit, TRUE, learn, judge, motion_band([*learn, *judge]))
    return place


def pushes_better(torque):
    """An amplifier that pushes by a third more than it pulls."""
    return torque + 0.15 * np.abs(torque)


def test_an_amplifier_that_pushes_better_than_it_pulls_is_drawn_with_its_law():
    place = drawn_over_input(pushes_better)
    # A surface over it comes as near, and a curve goes before that.
    (best,) = (one for one in place.maps[:2] if one.quantities == (INPUT,))
    assert explained_there(place.search, best) > 0.98
    effect = drawn(place.search, best)
    assert effect.table.variables == ("input",)
    at = np.array([-2.0, -1.0, 1.0, 2.0])
    assert effect.table.at(at) == pytest.approx(0.15 * np.abs(at), abs=0.05)
    law = law_of(place.search, best, effect)
    assert [term.text for term in law.terms] == ["s.abs(s.input)"]
    assert law.coefficients[0] == pytest.approx(0.15, rel=0.02)


@pytest.mark.parametrize("one_way", [True, False])
def test_where_the_input_has_one_sign_its_size_is_no_law_as_it_would_explain_itself(one_way, monkeypatch):
    asked = []
    monkeypatch.setattr(of_map, "sparse_law", lambda search, products: asked.extend(products))
    place = drawn_over_input(lambda torque: torque - 0.06 * torque**2, one_way=one_way)
    best = next(one for one in place.maps if one.quantities == (INPUT,))
    law_of(place.search, best, drawn(place.search, best))
    texts = {product.text for product in asked}
    assert ("s.abs(s.input)" in texts) != one_way
    assert {"s.input**2", "s.input**3", "1"} <= texts


@njit
def turned(torque, share, friction, lag):
    """Angles (n,) of a rigid joint whose torque varies with a sine of the angle (``share``), with smooth dry
    friction of which the direction lags by ``lag``, s."""
    q, v, lagging, h = 0.0, 0.0, 0.0, DT / FINE
    found = np.empty(len(torque))
    for k in range(len(torque)):
        found[k] = q
        for _ in range(FINE):
            acts = torque[k] * (1.0 - share * np.sin(0.4 * q))
            lagging += h * (v - lagging) / max(lag, h)
            v += h * (acts - 0.35 * v - friction * np.tanh(lagging / (0.02 + 10.0 * lag))) / 0.14
            q += h * v
    return found


def drawn_of(share=0.0, friction=0.0, lag=0.0, size=2.0):
    """The place of the maps of such a joint."""
    kinds = []
    for seed in (0, 1):
        torque = drive(seed, size)
        kinds.append([record(torque, turned(torque, share, friction, lag)[:, None], 1e-5)])
    fit = fit_whole(TRUE, noise_starts(TRUE, kinds[0])[1], kinds[0], iterations=8)
    (place,) = places_of(fit, TRUE, *kinds, motion_band([*kinds[0], *kinds[1]]))
    return place


def test_a_torque_constant_that_varies_with_the_angle_is_drawn_over_both():
    place = drawn_of(share=0.3)
    best = place.maps[0]
    assert best.quantities == (INPUT, "motor angle") and explained_there(place.search, best) > 0.85
    effect = drawn(place.search, best)
    assert effect.table.variables == ("input", "angle")
    # What is the same at all angles is the torque constant's, and all torques are in units of that.
    low, high = (np.full(2, effect.table.knots[1][k]) for k in (1, -2))
    given = np.array([-2.0, 2.0])
    expected = -0.3 * given * (np.sin(0.4 * high) - np.sin(0.4 * low))
    assert effect.table.at(given, high) - effect.table.at(given, low) == pytest.approx(expected, rel=0.3)
    law = law_of(place.search, best, effect)
    assert law.terms[0].text == "s.input * s.sin(p.order * s.position)"
    assert law.coefficients[0] == pytest.approx(-0.3, rel=0.15)


@pytest.mark.parametrize(("friction", "lag"), [(0.3, 0.0), (0.8, 0.0), (1.6, 0.0), (0.5, 0.01), (0.8, 0.02)])
def test_a_friction_is_drawn_over_the_motion_and_not_over_the_input(friction, lag):
    # The input's size has the sign of the velocity: with that it would explain itself. And with the velocity
    # it nearly has the acceleration, which a friction that lags follows.
    place = drawn_of(friction=friction, lag=lag)
    assert INPUT not in place.maps[0].quantities
    over = {one.quantities: explained_there(place.search, one) for one in place.maps}
    assert max(share for names, share in over.items() if INPUT in names) < 0.3 * max(over.values())
    for one in place.maps[:3]:
        law = law_of(place.search, one, drawn(place.search, one))
        assert friction < 1.6 or law is None or not any("s.input" in term.text for term in law.terms)


@pytest.mark.parametrize("slow", [True, False])
def test_a_surface_is_drawn_only_where_the_motion_fills_it(slow):
    """Round one loop a surface over two quantities is any function of the time within it."""
    kinds = []
    for phase, seed in ((0.0, 0), (0.3, 1)):
        one = 1.5 * np.sin(2.0 * np.pi * 0.3 * DT * np.arange(10000) + phase)
        torque = one if slow else drive(seed, 2.0)
        kinds.append([record(torque, swing(torque, 0.14, 0.35, 0.6, 0.0, 0.0, 0.0, 0.0)[:, None], 1e-5)])
    fit = fit_whole(TRUE, noise_starts(TRUE, kinds[0])[1], kinds[0], iterations=8)
    (place,) = places_of(fit, TRUE, *kinds, motion_band([*kinds[0], *kinds[1]]))
    surfaces = {one.quantities for one in place.maps if len(one.quantities) == 2}
    assert surfaces == {("motor angle", "motor velocity")} | (set() if slow else {(INPUT, "motor angle")})
    assert any(len(one.quantities) == 1 for one in place.maps)


def test_a_loop_fills_half_of_its_plane_at_most():
    phase, luck = np.linspace(0.0, 2.0 * np.pi, 2000), np.random.default_rng(3)
    assert filled(np.sin(phase), np.cos(phase)) < 0.5
    assert filled(np.sin(phase), np.sin(phase + 0.1)) < 0.4
    for steps in (np.sign(np.sin(phase)), np.ones(2000), np.maximum(np.sin(phase), 0.0)):
        assert filled(steps, np.cos(phase)) < 0.6, "equal values are one"
    assert filled(luck.normal(size=2000), luck.uniform(size=2000) ** 3) == 1.0


def test_the_best_curve_is_tried_whatever_surfaces_come_nearer():
    place = drawn_of(friction=0.3)
    for most in (1, 3):
        tried = [one for _, one in place.best(most)]
        assert tried[:most] == place.maps[:most]
        assert any(len(one.quantities) == 1 for one in tried) and len(tried) <= most + 1


def test_a_product_of_input_and_motion_meets_the_input_while_it_is_held():
    # The joint is simulated with the product acting; what the regression has of it is what acted, filtered.
    torque = drive(2, 2.0)
    (one,) = [record(torque, turned(torque, 0.3, 0.0, 0.0)[:, None], 1e-5)]
    (motion,) = (banded(r, True, 5.0) for r in [one])
    term = Product("j_motor", "motor", tuple(
        f for f in (*gained_functions(), *angle_functions(-3.0, 3.0)) if f.text in ("s.input", "s.position")
    ))
    fine = np.interp(motion.record.dt * np.arange(0, len(torque), 0.1), motion.time, motion.angle[:, 0])
    held = np.repeat(torque, 10)[: len(fine)] * fine
    acted = held[: 10 * (len(held) // 10)].reshape(-1, 10).mean(axis=1)
    expected = motion.filtered(motion.of_input(acted))
    found = term.columns(motion, TRUE)[:, 0]
    assert np.sqrt(np.mean((found - expected) ** 2)) < 0.005 * np.sqrt(np.mean(expected**2))


@pytest.mark.parametrize(
    ("acts", "coulomb"),
    [
        (lambda torque: torque, 0.0),
        (lambda torque: 1.2 * torque, 0.0),  # what is in proportion is the inertia's and the damping's
        (lambda torque: torque, 0.3),  # friction follows the velocity
    ],
)
def test_nothing_follows_the_input_where_all_of_it_acts(acts, coulomb):
    place = drawn_over_input(acts, coulomb)
    (over_input,) = (one for one in place.maps if one.quantities == (INPUT,))
    assert explained_there(place.search, over_input) < 0.0


@pytest.mark.parametrize("name", ["input", "deflection_rate"])
def test_an_entry_of_one_s_own_may_follow_all_that_an_equation_is_written_in(monkeypatch, name):
    """A law that a map suggested: the diagnosis that is to look for it ended in an error."""
    learn = made_of(pushes_better, 0)
    (motion,) = (banded(r, True, 5.0) for r in learn)
    like = EFFECTS["constant_torque"]
    entry = replace(like, name=f"own_{name}", equation=lambda s, p: p.torque * s.abs(getattr(s, name)))
    monkeypatch.setitem(EFFECTS, entry.name, entry)
    assert linear(entry, "torque") and follows_from_motion(entry)
    own = Hypothesis(entry, "j_motor", "motor", (), ("torque",), None)
    column = own.columns(motion, TRUE)[:, 0]
    if name == "input":
        expected = np.abs(motion.input[motion.kept]) * TRUE.parameters["torque_constant"]
        assert np.corrcoef(column, expected)[0, 1] > 0.95
    else:
        assert np.all(column == 0.0)  # a rigid body has none


def test_a_joint_that_flexes_has_no_surface_over_the_input():
    """A real flexible link had one in place of its motor's equation: in proportion to the input."""
    motions = [banded(r, True, 5.0) for r in made_of(pushes_better, 0)]
    for model, surface in ((TRUE, True), (STAGE, False)):
        over = [one.quantities for one in measured_over(model, motions, "motor")]
        assert (INPUT,) in over and ((INPUT, "motor angle") in over) == surface
