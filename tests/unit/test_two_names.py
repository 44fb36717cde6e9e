"""A law without a name has to be better than two names together: quadratic drag with dry friction looks like
a drag that grows faster than the square."""

from types import SimpleNamespace

import pytest

from haptic_teleop_sysid.diagnosis.decision.search.two_names import two_names


def explained(score, unnamed=False, by_current=0.0):
    """Stands in for an explanation, of which only this is asked."""
    effect = SimpleNamespace(entry=SimpleNamespace(unnamed=unnamed))
    return SimpleNamespace(score=score, effect=effect, by_current=by_current, fit=f"fit of {score}")


def best(found, best_so_far, further=False):
    """Stands in for `choose`: the best one, which beside another one needs a hundredth of its score."""
    assert further == (best_so_far > 0.0)
    found = [e for e in found if e.score >= 0.01 * best_so_far]
    if not found:
        return None
    one = max(found, key=lambda e: e.score)
    return SimpleNamespace(chosen=one, unnamed=one.effect.entry.unnamed)


def asked(law, names, beside):
    found = [law, *names]
    return [c.chosen.score for c in two_names(best(found, 0.0), found, lambda fit: beside[fit], best)]


@pytest.mark.parametrize(
    ("second", "told"),
    [
        (130.0, [900.0, 130.0]),
        (46.0, [900.0, 46.0]),
        (45.0, []),  # less than 5 % better than the law
        (-3.0, []),
    ],
)
def test_two_names_have_to_be_better_than_the_law_by_a_twentieth(second, told):
    law, drag = explained(900.0, unnamed=True), explained(900.0)
    law.score = 900.1
    assert asked(law, [drag], {"fit of 900.0": [explained(second)]}) == told


def test_of_little_they_have_to_be_better_by_eight_nats():
    law, drag = explained(40.0, unnamed=True), explained(30.0)
    assert asked(law, [drag], {"fit of 30.0": [explained(17.0)]}) == []
    assert asked(law, [drag], {"fit of 30.0": [explained(19.0)]}) == [30.0, 19.0]


def test_no_name_none_beside_it_or_another_law_is_no_pair():
    law, drag = explained(100.0, unnamed=True), explained(90.0)
    assert asked(law, [], {}) == []
    assert asked(law, [drag], {"fit of 90.0": []}) == []
    assert asked(law, [drag], {"fit of 90.0": [explained(60.0, unnamed=True)]}) == []


def test_what_the_currents_show_is_no_part_of_a_torque():
    law, shown = explained(100.0, unnamed=True), explained(90.0, by_current=20.0)
    assert asked(law, [shown], {}) == []
