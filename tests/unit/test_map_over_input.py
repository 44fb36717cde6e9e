"""A torque over the input: what an amplifier makes of a command that is no torque along the motion."""

import numpy as np
import pytest
from stepped_machines import RIGID, drive, record, swing

from haptic_teleop_sysid.diagnosis.evidence.drawn_map import drawn, explained_there
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.band import motion_band
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.latent import INPUT
from haptic_teleop_sysid.diagnosis.evidence.places_of_maps import places_of
from haptic_teleop_sysid.diagnosis.evidence.suggested_law.of_map import law_of
from haptic_teleop_sysid.estimation.whole_fit import fit_whole, noise_starts

TRUE = RIGID.with_values({"motor_inertia": 0.14, "motor_damping": 0.35})


def drawn_over_input(acts, coulomb=0.0):
    """The search and the maps of a joint on which ``acts``(command) acts, best first."""

    def made(seed):
        torque = drive(seed, 2.0)
        return [record(torque, swing(acts(torque), 0.14, 0.35, coulomb, 0.0, 0.0, 0.0, 0.0)[:, None], 1e-5)]

    learn, judge = made(0), made(1)
    fit = fit_whole(TRUE, noise_starts(TRUE, learn)[1], learn, iterations=8)
    (place,) = places_of(fit, TRUE, learn, judge, motion_band([*learn, *judge]))
    return place


def pushes_better(torque):
    """An amplifier that pushes by a third more than it pulls."""
    return torque + 0.15 * np.abs(torque)


def test_an_amplifier_that_pushes_better_than_it_pulls_is_drawn_with_its_law():
    place = drawn_over_input(pushes_better)
    best = place.maps[0]
    assert best.quantities == (INPUT,) and explained_there(place.search, best) > 0.98
    effect = drawn(place.search, best)
    assert effect.table.variables == ("input",)
    at = np.array([-2.0, -1.0, 1.0, 2.0])
    assert effect.table.at(at) == pytest.approx(0.15 * np.abs(at), abs=0.05)
    law = law_of(place.search, best, effect)
    assert [term.text for term in law.terms] == ["s.abs(s.input)"]
    assert law.coefficients[0] == pytest.approx(0.15, rel=0.02)


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
