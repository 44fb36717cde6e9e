"""The states of the teleoperation: what leads where, and what must never happen."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from haptic_teleop_control.teleoperation.machine import State, TeleoperationMachine


def engaged(auto: bool = False) -> TeleoperationMachine:
    machine = TeleoperationMachine(auto)
    machine.cycle(True, True)
    assert machine.engage(True, True)
    return machine


def test_it_goes_from_off_to_engaged_only_by_an_act_and_through_aligning():
    entered: list[State] = []
    machine = TeleoperationMachine(on_enter=entered.append)
    for _ in range(3):
        assert machine.cycle(False, True) is State.OFF
    for _ in range(3):
        assert machine.cycle(True, True) is State.DEVICES_READY
    assert machine.engage(True, True)
    assert entered == [State.DEVICES_READY, State.ALIGNING, State.ENGAGED]


def test_an_act_out_of_alignment_begins_to_align_and_is_not_kept():
    machine = TeleoperationMachine()
    machine.cycle(True, False)
    assert not machine.engage(True, False)
    assert machine.state is State.ALIGNING
    for _ in range(5):
        assert machine.cycle(True, True) is State.ALIGNING
    assert machine.engage(True, True)


def test_auto_engages_as_soon_as_both_sides_are_there_and_aligned():
    machine = TeleoperationMachine(auto_engage=True)
    assert machine.cycle(False, True) is State.OFF
    assert machine.cycle(True, False) is State.ALIGNING
    assert machine.cycle(True, True) is State.ENGAGED
    fresh = TeleoperationMachine(auto_engage=True)
    assert fresh.cycle(True, True) is State.ENGAGED  # in one cycle


def test_a_side_that_goes_missing_is_a_fault_where_something_is_driven_and_off_where_not():
    ready = TeleoperationMachine()
    ready.cycle(True, True)
    assert ready.cycle(False, True) is State.OFF
    assert engaged().cycle(False, True) is State.FAULT
    aligning = TeleoperationMachine()
    aligning.cycle(True, False)
    aligning.engage(True, False)
    assert aligning.cycle(False, False) is State.FAULT


def test_losing_alignment_while_engaged_is_what_teleoperation_is_for():
    assert engaged().cycle(True, False) is State.ENGAGED


@pytest.mark.parametrize("auto", [False, True])
def test_a_fault_stays_until_reset_and_leads_to_aligning(auto):
    machine = engaged(auto)
    machine.fault()
    for _ in range(5):
        assert machine.cycle(True, True) is State.FAULT
    assert not machine.engage(True, True)
    assert not machine.disengage()
    assert machine.reset()
    assert machine.state is State.OFF
    assert machine.cycle(True, False) is State.ALIGNING
    assert machine.cycle(True, True) is (State.ENGAGED if auto else State.ALIGNING)


def test_reset_without_a_fault_changes_nothing():
    machine = engaged()
    assert not machine.reset()
    assert machine.state is State.ENGAGED


def test_after_disengaging_nothing_goes_on_by_itself_even_with_auto():
    machine = engaged(auto=True)
    assert machine.disengage()
    for _ in range(5):
        assert machine.cycle(True, True) is State.DEVICES_READY
    assert machine.engage(True, True)


def test_roles_may_change_only_where_nothing_is_driven_and_nothing_waits_for_a_reset():
    machine = TeleoperationMachine()
    assert machine.may_change_roles
    machine.cycle(True, False)
    assert machine.may_change_roles
    machine.engage(True, False)
    assert not machine.may_change_roles
    machine.engage(True, True)
    assert not machine.may_change_roles
    machine.fault()
    assert not machine.may_change_roles


ACTS = st.sampled_from(["cycle", "engage", "disengage", "fault", "reset"])


@given(st.booleans(), st.lists(st.tuples(ACTS, st.booleans(), st.booleans()), max_size=60))
def test_whatever_happens_the_rules_hold(auto, acts):
    entered: list[State] = []
    machine = TeleoperationMachine(auto, entered.append)
    for act, present, aligned in acts:
        before, seen = machine.state, len(entered)
        if act in ("cycle", "engage"):
            getattr(machine, act)(present, aligned)
        else:
            getattr(machine, act)()
        passed = [before, *entered[seen:]]
        for old, new in itertools.pairwise(passed):
            if new is State.ENGAGED:
                assert old is State.ALIGNING and present and aligned
                assert act == "engage" or (auto and act == "cycle")
            if old is State.FAULT:
                assert act == "reset" and new is State.OFF
            if new is State.ALIGNING:
                assert old is State.DEVICES_READY
        if act == "cycle" and not present:
            assert machine.state in (State.OFF, State.FAULT)
