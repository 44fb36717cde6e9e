"""Pacing: what is promised is the grid of multiples, not the lateness, which is the machine's. The clock here
stands still unless somebody sleeps on it or the work takes time."""

import threading
import time

import pytest

from haptic_teleop_control.clocks import SteadyClock, VirtualClock
from haptic_teleop_control.nodes.timing.deadline import DeadlineThread

MILLISECOND = 1_000_000


def ended(thread: DeadlineThread) -> None:
    """Waits for a thread whose work has stopped it."""
    end = time.monotonic() + 10.0
    while thread.alive:
        assert time.monotonic() < end, "it does not end"
        time.sleep(0.001)


def calls(cycles: int, took=lambda cycle: 0.0, **options) -> tuple[list[tuple[int, int]], DeadlineThread]:
    """(moment in ns, periods) of so many cycles of 10 ms, of which each took its time, s."""
    clock = VirtualClock(7 * MILLISECOND)
    found: list[tuple[int, int]] = []

    def work(periods: int) -> None:
        found.append((clock.now(), periods))
        if len(found) == cycles:
            thread.stop()
        clock.advance(took(len(found)))

    thread = DeadlineThread(0.01, work, clock=clock, **options)
    thread.start()
    ended(thread)
    return found, thread


def test_the_time_that_work_takes_does_not_delay_later_cycles():
    found, thread = calls(50, lambda cycle: 0.004)
    assert found == [((17 + 10 * k) * MILLISECOND, 1) for k in range(50)]
    assert (thread.cycles, thread.overruns, thread.worst_lateness) == (50, 0, 0.0)


def test_a_stall_is_skipped_and_counted_and_not_made_up_by_a_burst():
    found, thread = calls(6, lambda cycle: 0.045 if cycle == 3 else 0.0)
    moments = [moment // MILLISECOND for moment, _ in found]
    assert moments == [17, 27, 37, 82, 87, 97], "late at once, and then on the grid"
    assert [periods for _, periods in found] == [1, 1, 1, 4, 1, 1]
    assert thread.overruns == 3
    assert thread.worst_lateness == pytest.approx(0.035)


def test_by_the_machine_s_clock_no_cycle_comes_before_its_deadline():
    clock, moments = SteadyClock(), []

    def work(periods: int) -> None:
        moments.append(clock.now())
        if len(moments) == 30:
            thread.stop()

    begun = clock.now()
    thread = DeadlineThread(0.005, work)
    thread.start()
    ended(thread)
    assert all(moment - begun >= k * 5 * MILLISECOND for k, moment in enumerate(moments, start=1))


def test_an_error_in_the_work_ends_the_thread_and_is_handed_over():
    failures = []
    thread = DeadlineThread(0.005, lambda n: 1 / 0, on_failure=failures.append)
    thread.start()
    ended(thread)
    assert isinstance(failures[0], ZeroDivisionError)


def test_stop_returns_from_within_the_work_and_before_the_start():
    done = threading.Event()
    thread = DeadlineThread(0.005, lambda n: (thread.stop(), done.set()))
    thread.start()
    ended(thread)
    assert done.is_set()
    assert thread.cycles == 1
    assert DeadlineThread(1.0, lambda n: None).stop()


@pytest.mark.parametrize("period", [0.0, -1.0, float("nan")])
def test_a_period_that_is_none_is_refused(period):
    with pytest.raises(ValueError, match="positive"):
        DeadlineThread(period, lambda n: None)


@pytest.mark.parametrize("phase", [0.0, 0.5, 0.875])
def test_threads_of_different_phases_wake_at_their_shares_of_the_period_whenever_they_start(phase):
    found, _ = calls(20, phase=phase)
    assert {moment % (10 * MILLISECOND) for moment, _ in found} == {round(phase * 10 * MILLISECOND)}
    assert found[0][0] - 7 * MILLISECOND <= 10 * MILLISECOND
