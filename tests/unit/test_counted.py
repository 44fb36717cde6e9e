"""Numbers of things in words."""

import pytest

from haptic_teleop_control.counted import counted


@pytest.mark.parametrize(
    ("number", "words", "said"),
    [
        (1, ("hole",), "1 hole"),
        (0, ("hole",), "0 holes"),
        (2, ("hole",), "2 holes"),
        (1, ("row has", "rows have"), "1 row has"),
        (3, ("diagnosis", "diagnoses"), "3 diagnoses"),
    ],
)
def test_one_thing_is_one_thing_and_several_are_several(number, words, said):
    assert counted(number, *words) == said
