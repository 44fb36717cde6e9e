"""Which of several names stay where they leave much of what is missing."""

from dataclasses import replace

import numpy as np
import pytest
from stepped_machines import RIGID, pendulum

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision.adequacy import Adequacy
from haptic_teleop_sysid.diagnosis.decision.corroborated import Corroboration
from haptic_teleop_sysid.diagnosis.decision.name_tests.beside_the_others import earned, without
from haptic_teleop_sysid.diagnosis.decision.search.decide import Choice
from haptic_teleop_sysid.diagnosis.decision.search.rounds import SearchResult
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.group_search import search_groups
from haptic_teleop_sysid.diagnosis.hypotheses.explanation import Explanation
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales
from haptic_teleop_sysid.estimation.tuning import initial_noise
from haptic_teleop_sysid.estimation.whole_fit import fit_whole

RUB = Effect("coulomb_friction", "j_motor", {"torque": 0.1})
WEIGHT = Effect("gravity", "j_motor", {"torque": 1.5, "phase": 0.0})
STOP = Effect("spring_to_ground", "j_motor", {"stiffness": 0.5, "rest": 0.0})
SKEW = Effect("channel_skew", "j_motor_encoder", {"delay": 0.002})
BOTH = ["gravity", "channel_skew"]
NONE: dict[str, float] = {}
MUCH, LITTLE = Adequacy(0.8, 0.8), Adequacy(1.0, 1.0)


@pytest.fixture(scope="module")
def kept():
    """The names that stay of some, by what the free runs of each model err."""
    records = [pendulum(0, coulomb=0.0, weight=2.0)]
    like = fit_whole(RIGID, initial_noise(pack(RIGID), records), records, iterations=1)

    def answer(
        errors,
        *effects,
        adequate=MUCH,
        in_currents=(),
        left=lambda fit: 0.1,
        spread=NONE,
        white=False,
        gain=50.0,
        elsewhere=20.0,
        likelihood=like.log_likelihood,
    ):
        sizes = [f"{e.location}.{e.effect}.{next(iter(e.parameters))}" for e in effects]
        known = 1e8 * np.eye(len(like.free) + len(sizes))  # all to within 1e-4
        fits = [
            replace(
                like,
                log_likelihood=likelihood,
                model=RIGID.with_effects(*effects[:n]),
                free=(*like.free, *sizes[:n]),
                information=known[: len(like.free) + n, : len(like.free) + n],
            )
            for n in range(1, len(effects) + 1)
        ]
        choices = tuple(
            Choice(Explanation(fit, gain, elsewhere, True, i, by_current=float(e in in_currents)), 0.9)
            for i, (fit, e) in enumerate(zip(fits, effects, strict=True))
        )
        scales = recording_scales(RIGID, records)
        result = SearchResult(like, fits[-1], choices, (), scales)
        asked = Corroboration(errors, None), left, spread, lambda fit: white
        found = earned(result, adequate, records, *asked)
        names = [e.effect for e in found.final.model.effects]
        assert names == [c.chosen.effect.effect for c in found.choices]
        assert len(found.given_up) == len(effects) - len(names)
        return names, found

    return answer


def errs(**by_name):
    """Error of free runs: without any name 1, by a factor for each."""

    def errors(model):
        error = 1.0
        for effect in model.effects:
            error *= by_name[effect.effect]
        return error, error

    return errors


def test_a_name_that_free_runs_do_not_need_goes_and_the_others_are_fitted_again(kept):
    names, found = kept(errs(gravity=0.3, channel_skew=0.95), WEIGHT, SKEW)
    assert names == ["gravity"]
    assert found.final.model.effects[0].values["torque"] == pytest.approx(2.0, rel=0.1), "not 1.5"
    assert "channel_skew" in found.given_up[0].why


def test_what_free_runs_need_stays(kept):
    assert kept(errs(gravity=0.3, channel_skew=0.8), WEIGHT, SKEW)[0] == BOTH


def test_the_last_one_is_asked_first_and_one_name_is_not_asked(kept):
    nothing = errs(gravity=1.0, spring_to_ground=1.0, channel_skew=1.0)
    assert kept(nothing, WEIGHT, STOP, SKEW)[0] == ["gravity"]
    assert kept(nothing, SKEW)[0] == ["channel_skew"]


def test_where_names_explain_nearly_all_nothing_is_asked(kept):
    assert kept(errs(gravity=0.3, channel_skew=1.5), WEIGHT, SKEW, adequate=LITTLE)[0] == BOTH


def test_where_the_rest_is_random_only_what_makes_free_runs_worse_goes(kept):
    chance = Adequacy(0.8, 0.8, random_left=True)
    assert kept(errs(gravity=0.3, channel_skew=0.99), WEIGHT, SKEW, adequate=chance)[0] == BOTH
    assert kept(errs(gravity=0.3, channel_skew=1.1), WEIGHT, SKEW, adequate=chance)[0] == ["gravity"]


def test_what_the_currents_show_is_not_asked(kept):
    worse = errs(gravity=0.3, channel_skew=1.5)
    assert kept(worse, WEIGHT, SKEW, in_currents=(SKEW,))[0] == BOTH


def test_what_speaks_for_estimation_recordings_only_goes(kept):
    better_here = lambda model: (0.2, 0.29) if len(model.effects) > 1 else (0.3, 0.3)  # noqa: E731
    assert kept(better_here, WEIGHT, SKEW)[0] == ["gravity"]


@pytest.mark.parametrize("adequate", [MUCH, LITTLE])
def test_a_name_with_which_more_torque_is_missing_goes(kept, adequate):
    better = errs(gravity=0.3, channel_skew=0.5)
    more = lambda fit: 0.13 if len(fit.model.effects) > 1 else 0.1  # noqa: E731
    names, found = kept(better, WEIGHT, SKEW, adequate=adequate, left=more)
    assert names == ["gravity"]
    assert "more torque is missing" in found.given_up[0].why
    assert kept(better, WEIGHT, SKEW, adequate=adequate, left=lambda fit: 0.1)[0] == BOTH


def test_missing_torque_is_compared_at_the_same_noise_levels(kept):
    """With an encoder's error named its readings are less noisy, and the same observer adds more torque."""
    better, exact = errs(gravity=0.3, channel_skew=0.5), []

    def left(fit):
        exact.append(fit.noise)
        return (0.09 if len(fit.model.effects) > 1 else 0.1) * (3.0 if fit.noise == exact[0] else 1.0)

    assert kept(better, WEIGHT, SKEW, adequate=LITTLE, left=left)[0] == BOTH


def test_where_innovations_are_white_and_the_rest_is_random_a_clear_gain_counts(kept):
    chance, worse = Adequacy(0.8, 0.8, random_left=True), errs(gravity=0.3, channel_skew=1.3)
    clear = {"adequate": chance, "white": True, "likelihood": 1e9}
    names, found = kept(worse, WEIGHT, SKEW, **clear)
    assert names == BOTH and "run worse" in found.choices[1].unsure
    size = {"j_motor_encoder.channel_skew.delay": 0.004}
    needed = errs(gravity=0.3, channel_skew=0.9)
    assert kept(needed, WEIGHT, SKEW, **clear, spread=size)[0] == BOTH, "whatever its size"
    for less in (
        {"white": False},
        {"adequate": MUCH},  # not random
        {"gain": 29.0},
        {"elsewhere": 1.0},
        {"likelihood": -1e9},  # gained when it was found, and nothing beside the other
    ):
        assert kept(worse, WEIGHT, SKEW, **(clear | less))[0] == ["gravity"], less


def test_a_name_whose_size_is_not_known_has_no_place_beside_others(kept):
    needed, size = errs(gravity=0.3, channel_skew=0.5), "j_motor_encoder.channel_skew.delay"
    assert kept(needed, WEIGHT, SKEW, spread={size: 0.001})[0] == BOTH
    names, found = kept(needed, WEIGHT, SKEW, spread={size: 0.004})
    assert names == ["gravity"]
    assert "not known" in found.given_up[0].why
    assert kept(needed, SKEW, spread={size: 0.004})[0] == ["channel_skew"], "alone it stays, unsurely"


def test_of_a_name_that_spoils_the_other_recordings_nobody_is_sure(kept):
    here, there = errs(gravity=0.3, channel_skew=0.5), errs(gravity=0.3, channel_skew=1.1)
    split = lambda model: (here(model)[0], there(model)[1])  # noqa: E731
    names, found = kept(split, WEIGHT, SKEW, adequate=LITTLE)
    assert names == BOTH
    assert "do not bear out the channel skew" in found.choices[1].unsure
    assert not found.choices[0].unsure
    assert not any(c.unsure for c in kept(here, WEIGHT, SKEW, adequate=LITTLE)[1].choices)


def test_what_the_inverse_dynamics_name_they_fit_again_without_one_of_it():
    records = [pendulum(seed, coulomb=0.4, weight=2.0) for seed in (0, 1)]
    scales = recording_scales(RIGID, records[:1])
    like = fit_whole(RIGID, initial_noise(pack(RIGID), records[:1]), records[:1], iterations=1)
    final = replace(like, model=RIGID.with_effects(WEIGHT, RUB, STOP))
    choices = tuple(Choice(Explanation(final, 50.0, 20.0, True, i), 0.9) for i in range(3))
    said = search_groups(RIGID, records[:1], records[1:], scales)
    result = SearchResult(like, final, choices, (), scales, searched=said)
    found = {e.effect: e.values["torque"] for e in without(result, STOP, records[:1]).model.effects}
    assert found == {"gravity": pytest.approx(2.0, rel=0.03), "coulomb_friction": pytest.approx(0.4, rel=0.1)}
