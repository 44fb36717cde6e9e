"""The fault latch."""

from __future__ import annotations

import pytest

from haptic_teleop_control.faults import FaultLatch


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
