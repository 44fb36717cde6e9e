"""Columns of the inverse dynamics that are kept: no more than there is room for, and the same answers."""

import numpy as np
import pytest
from stepped_machines import RIGID, pendulum

from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics import kept
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.group_search import search_groups
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.kept import Kept
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales


def made(size):
    return lambda: np.full((size, 1), float(size))


def test_what_was_not_asked_for_the_longest_makes_room(monkeypatch):
    monkeypatch.setattr(kept, "ROOM", 100 * 8)
    columns = Kept()
    for name, size in (("one", 40), ("two", 50)):
        columns.of(name, made(size))
    columns.of("one", made(40))
    columns.of("three", made(30))
    assert [*columns] == ["one", "three"]
    assert columns.of("two", made(50)).shape == (50, 1), "made anew"
    assert [*columns] == ["three", "two"]
    # What is larger than all room is kept until the next.
    columns.of("four", made(200))
    assert [*columns] == ["four"]
    columns.of("five", made(60))
    assert [*columns] == ["five"]
    columns.drop("five")
    columns.of("six", made(100))
    assert [*columns] == ["six"]


@pytest.mark.parametrize("share", [0.2, 0.0])
def test_without_room_the_inverse_dynamics_say_the_same(monkeypatch, share):
    learn, judge = ([pendulum(seed, coulomb=0.3, weight=2.0)] for seed in (0, 1))
    scales = recording_scales(RIGID, learn)
    whole = search_groups(RIGID, learn, judge, scales)
    sides = [side.side for side in whole.folds.sides]
    monkeypatch.setattr(kept, "ROOM", int(share * max(part._known._size for part in sides[0].parts)))
    tight = search_groups(RIGID, learn, judge, scales)
    for one, other in zip(whole.levels, tight.levels, strict=True):
        assert [g.effects for g in one] == [g.effects for g in other]
        assert [g.gain for g in one] == [g.gain for g in other]
    assert tight.recoverable == whole.recoverable
