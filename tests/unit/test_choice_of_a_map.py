"""Which of several measured torques is taken, and with which parameters."""

from types import SimpleNamespace

import numpy as np
import pytest
from own_joint import TRUTH
from stepped_machines import RIGID, pendulum

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.diagnosis.evidence import measured_map as maps
from haptic_teleop_sysid.diagnosis.evidence import places_of_maps
from haptic_teleop_sysid.diagnosis.evidence.drawn_map import finer
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.band import motion_band
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.groups import Search
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.latent import Latent
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.regression import equations

#: Beside a free structure, and beside inertias and a spring that are held.
FREE, HELD = (SimpleNamespace(explained=lambda terms: terms[0].explained) for _ in range(2))


def tried(nats, explained, *quantities, search=FREE):
    """A map that gains ``nats`` and explains ``explained``."""
    latent = SimpleNamespace(quantities=quantities, explained=explained)
    fit = SimpleNamespace(log_likelihood=100.0 + nats)
    return maps._Tried((0.1, 0.1), search, latent, SimpleNamespace(), fit)


BASE = SimpleNamespace(log_likelihood=100.0)


@pytest.mark.parametrize(
    ("candidates", "taken"),
    [
        # Over all angles it follows every detail of the one recording, and knows nothing of other angles.
        ([tried(672.0, 0.957, "angle"), tried(586.0, 0.994, "angle in a turn")], 1),
        # What explains as much at another place, and predicts worse, is not it.
        ([tried(1002.0, 0.83, "arm angle"), tried(622.0, 0.89, "motor velocity")], 0),
        # A surface is taken only where no curve does as well.
        ([tried(100.0, 0.95, "angle", "velocity"), tried(95.0, 0.93, "velocity")], 1),
        ([tried(100.0, 0.95, "angle", "velocity"), tried(95.0, 0.6, "velocity")], 0),
        # Shares of what two searches leave are not of one thing: where only one equation has anything left,
        # a perfect map of it explains half of both.
        ([tried(100.0, 0.523, "velocity"), tried(90.0, 0.9, "motor angle", search=HELD)], 0),
        # Where nothing gains, the least bad one.
        ([tried(-5.0, -0.1, "angle"), tried(-50.0, -0.4, "velocity")], 0),
    ],
)
def test_a_map_is_chosen_by_what_it_predicts_and_by_what_it_explains_elsewhere(candidates, taken):
    assert maps._chosen(candidates, BASE) is candidates[taken]


def test_every_map_is_made_finer_before_they_are_ranked(monkeypatch):
    """Eighteen teeth to a turn are nothing to 25 knots, and all to a hundred."""
    coarse = [SimpleNamespace(quantities=("motor angle",), left=left) for left in range(7)]
    finest = SimpleNamespace(quantities=("motor angle",), left=-10)
    monkeypatch.setattr(places_of_maps, "finer", lambda search, one: finest if one is coarse[-1] else one)
    search = SimpleNamespace(left_over=lambda terms: terms[0].left)
    place = places_of_maps._place(search, coarse)
    assert place.maps == [finest, *coarse[:-1]]


def test_a_map_whose_arithmetic_fails_is_left_out(monkeypatch):
    one, other = (SimpleNamespace(quantities=("motor angle",), left=left) for left in (0, 1))

    def finer(search, map):
        if map is one:
            raise np.linalg.LinAlgError("singular")
        return map

    monkeypatch.setattr(places_of_maps, "finer", finer)
    search = SimpleNamespace(left_over=lambda terms: terms[0].left)
    assert places_of_maps._place(search, [one, other]).maps == [other]


def test_curves_that_are_not_taken_are_not_kept():
    """Their columns are as long as the recordings."""
    learn, judge = ([pendulum(seed, detent=0.8)] for seed in (0, 1))
    cutoff = motion_band([*learn, *judge])
    search = Search(RIGID, equations(RIGID, learn, cutoff), equations(RIGID, judge, cutoff))
    search.numbers = (200.0, 200.0)
    coarse = next(one for one in search.latents if one.quantities == ("motor angle",))
    taken = finer(search, coarse)
    for side in search.sides:
        assert [*side._own] == [*side.side._known] == [taken]
        assert not {one for pair in side._pairs for one in pair} - {taken}
    assert search.likelier((taken,)) >= search.likelier((coarse,))


@pytest.mark.parametrize(
    ("errors", "kept"), [((0.05, 0.06), True), ((0.05, 0.2), False), ((0.2, 0.05), False), (None, False)]
)
def test_parameters_that_free_runs_want_are_taken_if_they_err_no_more(monkeypatch, errors, kept):
    lab = Model("sfj", "stage1", "flexible_joint", dict(TRUTH))
    drawn, freely = SimpleNamespace(model="drawn", log_likelihood=9.0), SimpleNamespace(model="freely")
    latent = Latent("j_motor", "motor", ("motor angle",), ((0.0, 0.5, 1.0),), 0.1)
    place = places_of_maps.Place(SimpleNamespace(explained=lambda terms: 0.9), [latent], None)
    effect = SimpleNamespace(location="joint", effect="torque_map", table=None)
    for name, value in {
        "places_of": lambda *args: [place],
        "explained_there": lambda search, latent: 0.9,
        "drawn": lambda search, latent: effect,
        "_fitted": lambda *args: drawn,
        "law_of": lambda *args: None,
    }.items():
        monkeypatch.setattr(maps, name, value)
    base = SimpleNamespace(model=lab, log_likelihood=0.0)
    left = {"drawn": (0.1, 0.1), "freely": errors}

    def errs(model):
        return left[model] if isinstance(model, str) else (0.3, 0.3)

    resized = None if errors is None else freely
    found = maps.measured_map(base, lab, [], [], errs, cutoff=1.0, resized=lambda fit: resized)
    assert found.fit is (freely if kept else drawn)
    assert found.closed == pytest.approx(1.0 - (errors[1] if kept else 0.1) / 0.3)
