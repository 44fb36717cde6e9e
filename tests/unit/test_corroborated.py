"""What free runs and torques say of a finding, where the noise model does not hold."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from stepped_machines import RIGID, pendulum

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision.corroborated import Corroboration
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.group_search import search_groups
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales
from haptic_teleop_sysid.estimation.tuning import initial_noise
from haptic_teleop_sysid.estimation.whole_fit import fit_whole

WEIGHT = Effect("gravity", "j_motor", {"torque": 2.0, "phase": 0.0})
FRICTION = Effect("coulomb_friction", "j_motor", {"torque": 0.3})
RIPPLE = Effect("torque_ripple", "j_motor", {"amplitude": 0.02, "order": 7.0, "phase": 0.0})
SKEW = Effect("channel_skew", "j_motor_encoder", {"delay": 0.001})


@pytest.fixture(scope="module")
def asked():
    """How a pendulum with friction, whose free runs say nothing, answers for an effect beside gravity."""
    here, there = (pendulum(s, coulomb=0.3, weight=2.0) for s in (0, 1))
    said = search_groups(RIGID, [here], [there], recording_scales(RIGID, [here]))
    second_method = SimpleNamespace(searched=said, chosen=None)
    like = fit_whole(RIGID, initial_noise(pack(RIGID), [here]), [here], iterations=1)

    def answer(effect, *beside, errors=lambda model: (0.5, 0.5), second_method=second_method):
        fits = [replace(like, model=RIGID.with_effects(*e)) for e in (beside, (*beside, effect))]
        return Corroboration(errors, second_method)(fits[1], fits[0], effect)

    return answer


def test_the_torques_bear_out_what_is_there_and_nothing_else(asked):
    assert asked(FRICTION, WEIGHT)
    assert asked(WEIGHT, FRICTION)
    assert not asked(RIPPLE, WEIGHT, FRICTION)
    assert not asked(replace(FRICTION, parameters={"torque": 3.0}), WEIGHT), "ten times too large"


def test_a_time_stamp_is_no_torque_and_free_runs_decide(asked):
    assert not asked(SKEW, WEIGHT, FRICTION)
    assert asked(SKEW, errors=lambda model: (0.4, 0.3) if model.effects else (0.5, 0.5))
    assert not asked(SKEW, errors=lambda model: (0.49, 0.48) if model.effects else (0.5, 0.5))
    better_here = lambda model: (0.3, 0.9) if model.effects else (0.5, 0.5)  # noqa: E731
    assert not asked(SKEW, errors=better_here), "where it was fitted only"


def test_sizes_of_the_others_are_sought_anew_without_it(asked):
    # Friction of another form makes up for what the finding lacks, and is not needed beside all of it.
    small = replace(FRICTION, parameters={"torque": 0.1})
    rest = Effect("asymmetric_friction", "j_motor", {"positive": 0.2, "negative": 0.2})
    assert asked(rest, WEIGHT)
    assert not asked(rest, WEIGHT, small)


def test_free_runs_must_err_less_than_with_as_few_names_of_the_inverse_dynamics(asked):
    def answer(*named, errs):
        group = SimpleNamespace(model=RIGID.with_effects(*named), effects=named)
        other = SimpleNamespace(chosen=SimpleNamespace(group=group, errors=(errs, errs)))
        better = {0: 0.5, 1: 0.5, 2: 0.4}
        return asked(SKEW, FRICTION, errors=lambda m: (better[len(m.effects)],) * 2, second_method=other)

    assert answer(WEIGHT, errs=0.5)
    assert not answer(WEIGHT, errs=0.42), "what errs as little does without it"
    assert answer(WEIGHT, FRICTION, RIPPLE, errs=0.1), "more names explain more"
    assert answer(SKEW, errs=0.1), "the same name"


def test_without_equations_of_motion_free_runs_decide_alone(asked):
    assert not asked(FRICTION, WEIGHT, second_method=None)
    assert asked(FRICTION, WEIGHT, second_method=None, errors=lambda m: (0.5 / len(m.effects),) * 2)
