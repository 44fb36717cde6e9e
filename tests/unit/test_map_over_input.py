"""A torque over the input: what an amplifier makes of a command that is no torque along the motion."""

from dataclasses import replace

import numpy as np
import pytest
from numba import njit
from stepped_machines import DT, FINE, RIGID, drive, record, swing

from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sysid.diagnosis.evidence.drawn_map import drawn, explained_there
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.band import motion_band
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.latent import INPUT
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.motion import banded
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.sampled import linear
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.terms import Hypothesis
from haptic_teleop_sysid.diagnosis.evidence.places_of_maps import places_of
from haptic_teleop_sysid.diagnosis.evidence.suggested_law.of_map import law_of
from haptic_teleop_sysid.diagnosis.hypotheses.follows import follows_from_motion
from haptic_teleop_sysid.estimation.whole_fit import fit_whole, noise_starts

TRUE = RIGID.with_values({"motor_inertia": 0.14, "motor_damping": 0.35})


def made_of(acts, seed, coulomb=0.0):
    """A recording of a joint on which ``acts``(command) acts."""
    torque = drive(seed, 2.0)
    return [record(torque, swing(acts(torque), 0.14, 0.35, coulomb, 0.0, 0.0, 0.0, 0.0)[:, None], 1e-5)]


def drawn_over_input(acts, coulomb=0.0):
    """The search and the maps of such a joint, best first."""
    learn, judge = (made_of(acts, seed, coulomb) for seed in (0, 1))
    fit = fit_whole(TRUE, noise_starts(TRUE, learn)[1], learn, iterations=8)
    (place,) = places_of(fit, TRUE, learn, judge, motion_band([*learn, *judge]))
    return place


def pushes_better(torque):
    """An amplifier that pushes by a third more than it pulls."""
    return torque + 0.15 * np.abs(torque)


def test_an_amplifier_that_pushes_better_than_it_pulls_is_drawn_with_its_law():
    place = drawn_over_input(pushes_better)
    # Surfaces over it come as near, and a curve goes before them.
    assert all(INPUT in one.quantities for one in place.maps[:3])
    (best,) = (one for one in place.maps[:3] if one.quantities == (INPUT,))
    assert explained_there(place.search, best) > 0.98
    effect = drawn(place.search, best)
    assert effect.table.variables == ("input",)
    at = np.array([-2.0, -1.0, 1.0, 2.0])
    assert effect.table.at(at) == pytest.approx(0.15 * np.abs(at), abs=0.05)
    law = law_of(place.search, best, effect)
    assert [term.text for term in law.terms] == ["s.abs(s.input)"]
    assert law.coefficients[0] == pytest.approx(0.15, rel=0.02)


@njit
def turned(torque, share, weakens, friction):
    """Angles (n,) of a rigid joint whose torque varies with a sine of the angle (``share``), or falls with
    the velocity (``weakens``), with smooth dry friction."""
    q, v, h = 0.0, 0.0, DT / FINE
    found = np.empty(len(torque))
    for k in range(len(torque)):
        found[k] = q
        for _ in range(FINE):
            acts = torque[k] * (1.0 - share * np.sin(0.4 * q)) * (1.0 - weakens * abs(v))
            v += h * (acts - 0.35 * v - friction * np.tanh(v / 0.02)) / 0.14
            q += h * v
    return found


def drawn_of(share=0.0, weakens=0.0, friction=0.0, size=2.0):
    """The place of the maps of such a joint."""
    kinds = []
    for seed in (0, 1):
        torque = drive(seed, size)
        kinds.append([record(torque, turned(torque, share, weakens, friction)[:, None], 1e-5)])
    fit = fit_whole(TRUE, noise_starts(TRUE, kinds[0])[1], kinds[0], iterations=8)
    (place,) = places_of(fit, TRUE, *kinds, motion_band([*kinds[0], *kinds[1]]))
    return place


@pytest.mark.parametrize(
    ("acts", "other", "law"),
    [
        ({"share": 0.3}, "motor angle", "s.sin(p.order * s.position)"),
        ({"weakens": 0.1}, "motor velocity", "s.abs(s.velocity)"),
    ],
)
def test_a_torque_constant_that_varies_is_drawn_over_the_input_and_what_it_varies_with(acts, other, law):
    place = drawn_of(**acts)
    best = place.maps[0]
    assert best.quantities == (INPUT, other) and explained_there(place.search, best) > 0.85
    effect = drawn(place.search, best)
    assert effect.table.variables == ("input", {"motor angle": "angle", "motor velocity": "velocity"}[other])
    found = law_of(place.search, best, effect)
    assert found.terms[0].text == f"s.input * {law}"
    assert found.coefficients[0] == pytest.approx(-sum(acts.values()), rel=0.15)


def test_a_friction_that_carries_nearly_all_of_the_torque_is_not_the_input_itself():
    # The input's size has the sign of the velocity: over both of them it would explain itself.
    place = drawn_of(friction=1.6)
    over = {one.quantities: explained_there(place.search, one) for one in place.maps}
    assert over[("motor velocity",)] > 0.95 * max(over.values())
    for one in place.maps:
        law = law_of(place.search, one, drawn(place.search, one))
        assert law is None or not any("s.input" in term.text for term in law.terms)


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
