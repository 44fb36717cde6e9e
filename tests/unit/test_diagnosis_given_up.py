"""What falls with a name that is given up, what takes its place, and which of them are the encoders' steps:
asked with the single doubts answered by lists."""

from dataclasses import replace

import pytest
from diagnosis_rigs import DRAG, borne_out, fit_of, unimpressed
from identification_plants import STAGE

import haptic_teleop_sysid.diagnosis.decision.name_tests.doubt as doubt_module
from haptic_teleop_sysid.diagnosis.decision.name_tests import objections
from haptic_teleop_sysid.diagnosis.decision.name_tests.doubt import doubted
from haptic_teleop_sysid.diagnosis.decision.search.decide import Choice
from haptic_teleop_sysid.diagnosis.decision.search.rounds import SearchResult
from haptic_teleop_sysid.diagnosis.decision.stand import Stand
from haptic_teleop_sysid.diagnosis.hypotheses.explanation import Explanation


@pytest.fixture
def believing(monkeypatch):
    """`doubted` with its questions answered by lists: the explanations that are the encoders' steps, and
    those that something else speaks against; what to call with choices gives what is kept, and the doubt."""
    steps, refuted, asked = [], [], []

    def shows(found, before, records):
        asked.append((found.fit, before))
        return any(found is one for one in steps)

    def objection(self, choice, so_far):
        return ("it has another size", None) if any(choice.chosen is one for one in refuted) else None

    replaced = {
        "rounding_shows": shows,
        "more_coloured": lambda *_: False,
        "by_steps": lambda *_: True,
        "colour": lambda *_: 200.0,
        "held_out_fit": lambda fit, *_: fit,
        "stand_of": lambda *_: Stand((0.0, 0.0), (0.0, 0.0), {}),
        "stands_out": lambda *_: True,
        "rather_event": lambda doubt, both: doubt,
    }
    for name, what in replaced.items():
        monkeypatch.setattr(doubt_module, name, what)
    monkeypatch.setattr(objections.Objections, "to", objection)

    def ask(*choices):
        fit = choices[-1].chosen.fit
        result = SearchResult(fit_of(), fit, choices, (), None)
        kept, doubt, _ = doubted(result, [], [], unimpressed, borne_out)
        return [c.chosen for c in kept.choices], doubt

    return ask, steps, refuted, asked


def explanations(count):
    model = STAGE.with_effects(DRAG)
    return [Explanation(fit_of(model, float(n)), 400.0 + n, 400.0, True, 0) for n in range(count)]


def test_a_first_finding_may_be_the_encoders_steps_and_takes_what_was_found_beside_it_along(believing):
    ask, steps, _, asked = believing
    first, second = explanations(2)
    assert ask(Choice(first, 1.0), Choice(second, 1.0)) == ([first, second], None)
    assert [fit.log_likelihood for fit, _ in asked] == [0.0, 1.0]
    assert asked[1][1] is first.fit
    steps.append(first)
    kept, doubt = ask(Choice(first, 1.0), Choice(second, 1.0))
    assert kept == [] and "encoders this coarse" in doubt.why
    # What the current shows is no matter of the encoders.
    seen = replace(first, by_current=50.0)
    steps.append(seen)
    assert ask(Choice(seen, 1.0)) == ([seen], None)


def test_what_takes_the_place_of_a_name_that_was_given_up_is_asked_about_the_encoders_too(believing):
    ask, steps, refuted, _ = believing
    first, rival = explanations(2)
    refuted.append(first)
    assert ask(Choice(first, 0.6, ((rival, 0.4),))) == ([rival], None)
    steps.append(rival)
    kept, doubt = ask(Choice(first, 0.6, ((rival, 0.4),)))
    assert kept == [] and doubt is not None


def test_what_merely_predicts_the_same_falls_with_the_name_it_was_behind(believing):
    ask, _, refuted, _ = believing
    first, rival = explanations(2)
    refuted.append(first)
    kept, doubt = ask(Choice(first, 0.65, ((rival, 0.35),), alike=0.35))
    assert kept == [] and doubt.choice.chosen is first
