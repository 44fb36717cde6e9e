"""The fault latch, and the checks of a received command."""

from __future__ import annotations

import math

import pytest

from haptic_teleop_control.faults import COMMAND_FAULTS, FaultLatch, command_fault


def test_the_first_fault_stays_latched_and_later_ones_are_only_counted():
    latch = FaultLatch({"stale": "too old; look at the publisher", "limit": "over the limit"})
    assert latch.latched is None and latch.sentence is None
    assert latch.count("limit", "0.95 A") is True
    assert latch.count("stale") is False
    assert latch.count("limit", "1.2 A") is False
    assert latch.latched == "limit"
    assert latch.detail == "0.95 A"
    assert latch.counts == {"stale": 1, "limit": 2}
    assert latch.total == 3
    assert latch.sentence == "limit: over the limit (0.95 A)."


def test_only_a_reset_unlatches_and_it_keeps_the_counts():
    latch = FaultLatch(["a", "b"])
    latch.count("a")
    assert latch.reset() == "a"
    assert latch.latched is None and latch.detail == "" and latch.counts == {"a": 1, "b": 0}
    assert latch.reset() is None
    assert latch.count("b") is True and latch.latched == "b" and latch.sentence == "b."


def test_counts_cannot_be_changed_from_outside():
    latch = FaultLatch(["a"])
    latch.counts["a"] = 5
    assert latch.counts == {"a": 0}


def test_an_undeclared_name_is_a_mistake_of_the_program():
    with pytest.raises(KeyError):
        FaultLatch(["a"]).count("b")


@pytest.mark.parametrize(
    ("values", "age", "expected"),
    [
        ([0.1, -0.2], 0.0, None),
        ([0.1, -0.2], 0.05, None),
        ([0.1, -0.2], 0.0501, "stale_command"),
        ([0.1, -0.2], math.nan, "stale_command"),
        ([0.1, -0.2], math.inf, "stale_command"),
        ([0.1, math.nan], 0.0, "non_finite_command"),
        ([-math.inf, 0.0], 9.0, "non_finite_command"),
        ([0.1], 0.0, "malformed_command"),
        ([], 0.0, "malformed_command"),
        ([0.1, 0.2, 0.3], 0.0, "malformed_command"),
        (None, 0.0, "missing_command"),
    ],
)
def test_a_command_is_used_only_when_present_complete_finite_and_fresh(values, age, expected):
    assert command_fault(values, age, maximum_age=0.05, size=2) == expected
    if expected is not None:
        FaultLatch(COMMAND_FAULTS).count(expected)
