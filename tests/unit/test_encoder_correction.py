"""An encoder that errs is told from a smooth warp of the angle that only looks like one."""

import re
from dataclasses import replace

import numpy as np
import pytest
from stepped_machines import RIGID, pendulum

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision.finding import finding
from haptic_teleop_sysid.diagnosis.decision.name_tests.encoder_correction import misread
from haptic_teleop_sysid.diagnosis.decision.search.decide import Choice
from haptic_teleop_sysid.diagnosis.decision.search.rounds import SearchResult
from haptic_teleop_sysid.diagnosis.decision.words import because
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.corrected import corrected
from haptic_teleop_sysid.diagnosis.hypotheses.explanation import Explanation
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales
from haptic_teleop_sysid.estimation.whole_fit import fit_whole, noise_starts

AMPLITUDE, ORDER, PHASE = 0.03, 2.0, 0.4
ERROR = Effect(
    "encoder_eccentricity", "j_motor_encoder", {"amplitude": AMPLITUDE, "order": ORDER, "phase": PHASE}
)
TORQUES = (
    Effect("gravity", "j_motor", {"torque": 2.0}),
    Effect("coulomb_friction", "j_motor", {"torque": 0.3}),
)


def erring(record):
    """What an encoder reads that errs, written once more."""
    true = record.measured[:, 0]
    read = record.measured.copy()
    read[:, 0] = true + AMPLITUDE * (np.sin(ORDER * true + PHASE) - np.sin(PHASE))
    return replace(record, measured=read)


def found(learn, *errors):
    """A search's result that names both torques, and errors of the encoder after them."""
    scales = recording_scales(RIGID, learn)
    fit = fit_whole(RIGID, noise_starts(RIGID, learn)[1], learn, free=(), iterations=2)
    choices = []
    named = (*TORQUES, *errors)
    for i, _ in enumerate(named):
        model = RIGID.with_effects(*named[: i + 1])
        choices.append(Choice(Explanation(replace(fit, model=model), 50.0, 20.0, True, i), 1.0))
    return SearchResult(fit, choices[-1].chosen.fit, tuple(choices), (), scales)


def test_what_is_taken_out_is_what_the_encoder_adds():
    true = pendulum(0, coulomb=0.3, weight=2.0)
    assert corrected(erring(true), ERROR).measured[:, 0] == pytest.approx(true.measured[:, 0], abs=1e-6)


@pytest.mark.parametrize("errs", [True, False])
def test_an_error_of_the_encoder_stands_only_where_the_torques_fit_no_worse_without_it(errs):
    learn, judge = ([pendulum(seed, coulomb=0.3, weight=2.0)] for seed in (0, 1))
    if errs:
        learn, judge = ([erring(r) for r in records] for records in (learn, judge))
    result = found(learn, ERROR)
    same, told = misread(result, RIGID, learn, judge, 8.0)
    if errs:
        assert told is None
        assert same.choices == result.choices, "the torques confirm it"
    else:
        choice, why = told
        assert choice is result.choices[-1]
        assert re.search(r"the torques fit worse: [\d.]+ times as much", why)


def test_nobody_is_sure_of_an_error_of_the_encoder_that_the_torques_do_not_confirm():
    """One too small for the torques to say anything of it."""
    learn, judge = ([pendulum(seed, coulomb=0.3, weight=2.0)] for seed in (0, 1))
    slight = Effect(ERROR.effect, ERROR.location, ERROR.parameters | {"amplitude": 3e-5})
    result = found(learn, slight)
    asked, told = misread(result, RIGID, learn, judge, 8.0)
    assert told is None
    assert asked.choices[:-1] == result.choices[:-1]
    sure, unsure = result.choices[-1], asked.choices[-1]
    before, after = (finding(one, result.final, {})["confidence"] for one in (sure, unsure))
    assert after < 0.7 <= before
    percent = re.search(r"the torques do not confirm it: (\d+) % of what is left", because(unsure, slight))
    assert 90 < int(percent[1]) <= 110


def test_an_error_that_is_not_confirmed_stays_unsure_beside_one_that_is_given_up():
    learn, judge = ([pendulum(seed, coulomb=0.3, weight=2.0)] for seed in (0, 1))
    slight = Effect("encoder_scale", ERROR.location, {"scale": 1.00003})
    asked, (given_up, _) = misread(found(learn, slight, ERROR), RIGID, learn, judge, 8.0)
    assert given_up is asked.choices[-1]
    assert asked.choices[-2].unsure
