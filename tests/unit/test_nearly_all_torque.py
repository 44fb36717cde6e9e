"""Names that explain nearly all the torque, although a likelihood asks for more."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from stepped_machines import RIGID, pendulum

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision.adequacy import Adequacy
from haptic_teleop_sysid.diagnosis.decision.reasons import Doubt
from haptic_teleop_sysid.diagnosis.decision.search.decide import Choice
from haptic_teleop_sysid.diagnosis.decision.search.rounds import SearchResult
from haptic_teleop_sysid.diagnosis.decision.second_method.nearly_all_torque import nearly_all_torque
from haptic_teleop_sysid.diagnosis.decision.verdict import decide_verdict
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.group_search import search_groups
from haptic_teleop_sysid.diagnosis.evidence.second_method import SecondMethod
from haptic_teleop_sysid.diagnosis.examined import Examined
from haptic_teleop_sysid.diagnosis.hypotheses.explanation import Explanation
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales
from haptic_teleop_sysid.diagnosis.nearly_all import nearly_all
from haptic_teleop_sysid.estimation.whole_fit import fit_whole, noise_starts
from haptic_teleop_sysid.simulation.parameter_fit import ParameterFit

#: Errors of free runs that say nothing for or against a name.
ALIKE = (0.5, 0.5)


def asked(**physics):
    """What the inverse dynamics say of a pendulum, and the recordings."""
    learn, judge = ([pendulum(seed, **physics)] for seed in (0, 1))
    scales = recording_scales(RIGID, learn)
    return search_groups(RIGID, learn, judge, scales), learn, judge, scales


@pytest.fixture(scope="module")
def heavy_and_rubbing():
    return asked(weight=4.0, coulomb=0.4)


def found_in(said, learn, judge, scales):
    """What was found in recordings whose free runs err less with any name."""
    baseline = fit_whole(RIGID, noise_starts(RIGID, learn)[1], learn, iterations=5)

    def errors(model):
        return (0.1, 0.1) if model.effects else ALIKE

    return SimpleNamespace(
        given=RIGID,
        learn=learn,
        judge=judge,
        result=SearchResult(baseline, baseline, (), (), scales),
        second_method=SecondMethod(None, (), said),
        horizons=SimpleNamespace(errors=errors),
        errors=errors,
        simulated=lambda model: ParameterFit(model, True, (1.0, 1.0), 1),
        course=SimpleNamespace(percent=lambda model: [50.0, 50.0]),
        count=1,
        cutoff=said.cutoff,
    )


def names(second_method):
    return {e.effect for e in second_method.chosen.group.effects}


def test_the_fewest_names_are_told_that_leave_nothing_with_a_shape(heavy_and_rubbing):
    said = heavy_and_rubbing[0]
    # Gravity alone is nearly all, and what it leaves is a curve over the velocity.
    assert said.levels[0][0].explained > 0.9
    found = nearly_all_torque(said, lambda m: ALIKE, [ALIKE])
    assert names(found) == {"gravity", "coulomb_friction"}
    first, *others = (weight for _, weight in found.rivals)
    assert first >= max(others, default=0.0) and sum([first, *others]) == pytest.approx(1.0)


def test_what_runs_worse_than_without_is_not_told(heavy_and_rubbing):
    worse = nearly_all_torque(heavy_and_rubbing[0], lambda m: (0.4, 0.6) if m.effects else ALIKE, [ALIKE])
    assert worse is None
    # Nor what runs no better than the mean, however bad it is without.
    assert nearly_all_torque(heavy_and_rubbing[0], lambda m: (0.9, 1.1), [(2.0, 2.0)]) is None


def test_physics_without_a_name_gets_none():
    said = asked(weight=4.0, swirl=1.5)[0]  # viscous friction that grows and falls with the angle
    assert nearly_all_torque(said, lambda m: ALIKE, [ALIKE]) is None


def test_a_shape_of_what_is_left_is_no_matter_where_free_runs_hardly_err(heavy_and_rubbing):
    """A ball screw: its friction explained 97 % of the torque, free runs erred by 3 %, and a curve beside it
    by less: it was `unknown`."""
    said = asked(weight=4.0, swirl=0.2)[0]
    best = said.levels[0][0]
    assert best.explained > 0.9 and said.beside(best)[1] > 0.5

    def found(error):
        return nearly_all_torque(said, lambda m: (error, error) if m.effects else ALIKE, [ALIKE])

    assert found(0.06) is None
    assert names(found(0.02)) == {"gravity"}
    # Names that leave no shape come first.
    both = nearly_all_torque(heavy_and_rubbing[0], lambda m: (0.02, 0.02) if m.effects else ALIKE, [ALIKE])
    assert names(both) == {"gravity", "coulomb_friction"}


@pytest.mark.parametrize(("recoverable", "told"), [(1.0, False), (0.95, True)])
def test_nearly_all_is_of_what_any_torque_explains(heavy_and_rubbing, monkeypatch, recoverable, told):
    """A balancing robot: gravity and a delay explain 89.9 % of the torque, and nothing explains more."""
    said = replace(heavy_and_rubbing[0], recoverable=recoverable)
    monkeypatch.setattr(said.folds, "explained", lambda terms: 0.88 if len(terms) > 1 else 0.5)
    second_method = nearly_all_torque(said, lambda m: ALIKE, [ALIKE])
    assert (second_method is not None) is told


def law(place=None, name="quadratic_drag"):
    """What speaks against a name, for a place or for none."""
    effect = Effect(name, "j_motor", {"coefficient": 0.1})
    named = Explanation(SimpleNamespace(model=RIGID.with_effects(effect)), 30.0, 10.0, True, 0)
    return Doubt(Choice(named, 1.0), "its law is not the joint's", place=place)


def asked_of(found, doubt):
    """The examined answer of which nothing is left but a doubt."""
    return Examined(found.result, doubt, None, None, None, {})


def belief_in(found):
    return SimpleNamespace(found=found, stand=SimpleNamespace(spread={}))


def test_an_answer_that_would_be_unknown_has_the_names_unsurely(heavy_and_rubbing):
    found = found_in(*heavy_and_rubbing)
    after = nearly_all(belief_in(found), asked_of(found, law()))
    assert after.doubt is None and after.adequate.content()["nearly_all_the_torque"]
    verdict = decide_verdict(after.result, found.learn, found.judge, after.doubt, {}, after.adequate)
    assert verdict.kind != "unknown"
    told = {f["effect"]: f for f in verdict.findings}
    assert set(told) == {"gravity", "coulomb_friction"}
    assert told["gravity"]["parameters"]["torque"]["value"] == pytest.approx(4.0, rel=0.1)
    assert told["coulomb_friction"]["parameters"]["torque"]["value"] == pytest.approx(0.4, rel=0.15)
    assert all(f["confidence"] <= 0.69 for f in verdict.findings)
    assert all("its law is not the joint's" in f["because"] for f in verdict.findings)


@pytest.mark.parametrize(
    "doubt",
    [
        law(place="j_actuator"),
        Doubt(None, "the recordings disagree about the parameters", "which recording it is"),
        None,
    ],
)
def test_what_is_known_of_a_place_or_doubted_of_the_recordings_stays(heavy_and_rubbing, doubt):
    found = found_in(*heavy_and_rubbing)
    before = asked_of(found, doubt)
    assert nearly_all(belief_in(found), before) is before


@pytest.mark.parametrize(("own", "stays"), [(90.0, True), (-80.0, False)])
def test_only_a_model_that_follows_the_motion_is_better(heavy_and_rubbing, own, stays):
    """The user's model simulates better by 10 points: better than the mean, or still worse than that."""
    found = found_in(*heavy_and_rubbing)
    found.course.percent = lambda model: [own - 10.0 * bool(model.effects)] * 2
    before = asked_of(found, law())
    assert (nearly_all(belief_in(found), before) is before) is stays


def test_a_sensor_that_has_a_name_is_not_given_up_for_torques(heavy_and_rubbing):
    found = found_in(*heavy_and_rubbing)
    wrong = Effect("encoder_scale", "j_motor_encoder", {"scale": 1.1})
    fit = replace(found.result.baseline, model=RIGID.with_effects(wrong))
    choice = Choice(Explanation(fit, 30.0, 10.0, True, 0), 1.0)
    result = replace(found.result, choices=(choice,), final=fit)
    before = Examined(result, None, None, None, Adequacy(0.1, 0.1), {})
    assert before.adequate.much_is_left
    assert nearly_all(belief_in(found), before) is before
