"""docs/effects.md: the committed table has every effect, as its entry describes it."""

import re
from pathlib import Path

import pytest

from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sysid.report.numbers import unit_text

PAGE = Path(__file__).resolve().parents[2] / "docs" / "effects.md"
ROW = re.compile(r"^\| `(\w+)` \| ([^|]+) \| ([^|]+) \| ([^|]+) \| ([^|]+) \|$", re.M)


@pytest.fixture(scope="module")
def tables():
    """Rows (name in prose, sentence, places, parameters) by effect: table of names, table of the others."""
    named, others = PAGE.read_text(encoding="utf-8").split("\n## Never reported by name\n")
    return [{effect: tuple(cells) for effect, *cells in ROW.findall(part)} for part in (named, others)]


def test_every_effect_stands_in_the_table_once_and_nothing_else_does(tables):
    never = {name for name, e in EFFECTS.items() if e.unnamed or e.tabulated or e.nuisance}
    assert tables[0].keys() == EFFECTS.keys() - never
    assert tables[1].keys() == never


@pytest.mark.parametrize("effect", EFFECTS)
def test_a_row_has_the_sentence_the_places_and_the_parameters_of_the_entry(tables, effect):
    name, sentence, places, parameters = (tables[0] | tables[1])[effect]
    assert sentence == EFFECTS[effect].sentence
    assert tuple(places.split(", ")) == EFFECTS[effect].where
    told = [(p.name, unit_text(p.unit).strip("()")) for p in EFFECTS[effect].parameters if not p.numerical]
    assert re.findall(r"`(\w+)` \(([^)]+)\)", parameters) == told
    # The name in prose is the identifier in words; a synonym may follow it.
    assert name.partition(" (")[0].lower().replace("-", " ") == effect.replace("_", " ")
