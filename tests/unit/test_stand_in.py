"""The nearest name stands in for physics without one where it simulates clearly better, and only there."""

import math
from dataclasses import replace

import numpy as np
import pytest
from stepped_machines import RIGID

from haptic_teleop_sim.model import Effect, load_model
from haptic_teleop_sysid.diagnosis.decision.reasons import Doubt
from haptic_teleop_sysid.diagnosis.decision.search.decide import Choice
from haptic_teleop_sysid.diagnosis.decision.unknown.stand_in import stand_in
from haptic_teleop_sysid.diagnosis.hypotheses.explanation import Explanation
from haptic_teleop_sysid.diagnosis.report.summary import map_sentences
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.noise import NoiseModel
from haptic_teleop_sysid.runs.diagnosis_run import comments
from haptic_teleop_sysid.runs.told_roles import told_role

GIVEN = replace(RIGID, source="given")
NOISE = NoiseModel(0.1, 0.1, 1e-4, 1e-4)
FRICTION = Effect("coulomb_friction", "j_motor", {"torque": 0.9})


def fit_of(*effects):
    model = replace(RIGID, effects=effects, source="fitted")
    return Fit(model, NOISE, (), -1.0, np.zeros((0, 0)), np.zeros(0), True, 1, "")


def doubted(effect):
    explanation = Explanation(fit_of(effect), 50.0, 50.0, True, 0)
    return Doubt(Choice(explanation, 0.46, ()), "it explains 46 % of what a free curve explains")


def asked(with_it, without=(0.34, 0.42), given=(0.40, 0.37), doubt=None):
    def errors(model):
        return with_it if model.effects else given if model.source == "given" else without

    return stand_in(fit_of(), GIVEN, doubt or doubted(FRICTION), errors)


def test_what_halves_the_error_stands_in_and_is_not_said_to_be_what_is_missing():
    found = asked((0.13, 0.18))
    assert found.fit.model.effects == (FRICTION,)
    # Beside the better of the two models without it on these recordings, which is the given one.
    assert found.closed == pytest.approx(1.0 - 0.18 / 0.37)
    told = found.content([])
    assert [e["effect"] for e in told["effects"]] == ["coulomb_friction"]
    assert told["effects"][0]["parameters"]["torque"] == 0.9
    sentence = map_sentences({"torque_map": {"what": "no map was added"}, "stand_in": told})[-1]
    assert "coulomb_friction at j_motor" in sentence and "51 %" in sentence and "is not believed" in sentence


def test_the_model_that_is_handed_on_says_what_it_is(tmp_path):
    told = asked((0.13, 0.18)).content([])
    held = {"holds": "augmented", "what": "your structure, with a stand-in that is not believed"}
    content = {"verdict": "unknown", "augmented_model": held, "stand_in": told}
    place = tmp_path / "augmented_model.yaml"
    fit_of(FRICTION).model.save(place, comments(content))
    above = [line for line in place.read_text().splitlines() if line.startswith("#")]
    assert "verdict unknown" in above[0] and "stand-in" in above[0] and "is not believed" in above[1]
    assert load_model(place).effects[0].effect == "coulomb_friction"
    content |= {"verdict": "identified", "stand_in": None}
    assert len(comments(content)) == 2
    assert told_role(place) == "augmented"


@pytest.mark.parametrize(
    "case",
    [
        {"with_it": (0.13, 0.33)},  # a tenth better than what there is
        {"with_it": (0.13, 0.18), "given": (0.3, 0.2)},  # the lab's own model is nearly as good
        {"with_it": (0.35, 0.18)},  # worse where it was fitted
        {"with_it": (math.nan, 0.18)},
        {"with_it": (0.13, 0.18), "doubt": Doubt(None, "nothing was named")},
        {"with_it": (0.13, 0.18), "doubt": doubted(Effect("steep_drag", "j_motor", {"coefficient": 1.0}))},
    ],
)
def test_what_simulates_hardly_better_or_has_no_name_does_not(case):
    assert asked(**case) is None
