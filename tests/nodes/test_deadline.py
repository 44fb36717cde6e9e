"""Pacing: what is promised is the grid of multiples, not the lateness, which is the machine's."""

import threading
import time

import numpy as np
import pytest

from haptic_teleop_control.nodes.timing.deadline import DeadlineThread


def run_until(condition, deadline=5.0):
    end = time.monotonic() + deadline
    while not condition():
        assert time.monotonic() < end, "not in time"
        time.sleep(0.001)


def test_the_time_that_work_takes_does_not_delay_later_cycles():
    periods = []
    thread = DeadlineThread(0.01, lambda n: (periods.append(n), time.sleep(0.004)))
    begun = time.monotonic()
    thread.start()
    run_until(lambda: sum(periods) >= 50)
    elapsed = time.monotonic() - begun
    assert thread.stop()
    # A relative sleep would need 0.7 s for 50 periods; the grid needs 0.5 s, whatever single cycles were
    # late.
    assert 0.49 < elapsed < 0.6


def test_a_stall_is_skipped_and_counted_and_not_made_up_by_a_burst():
    calls = []

    def work(periods):
        calls.append((time.monotonic(), periods))
        if len(calls) == 3:
            time.sleep(0.09)

    thread = DeadlineThread(0.02, work)
    thread.start()
    run_until(lambda: len(calls) >= 6)
    thread.stop()
    after = calls[3]
    assert after[1] >= 4
    assert thread.overruns == sum(periods - 1 for _, periods in calls)
    assert calls[5][0] - calls[3][0] > 0.02, "two cycles follow the stall within less than a period"


def test_an_error_in_the_work_ends_the_thread_and_is_handed_over():
    failures = []
    thread = DeadlineThread(0.005, lambda n: 1 / 0, on_failure=failures.append)
    thread.start()
    run_until(lambda: not thread.alive)
    assert isinstance(failures[0], ZeroDivisionError)


def test_stop_returns_from_within_the_work_and_before_the_start():
    done = threading.Event()
    thread = DeadlineThread(0.005, lambda n: (thread.stop(), done.set()))
    thread.start()
    run_until(lambda: done.is_set() and not thread.alive)
    assert thread.cycles == 1
    assert DeadlineThread(1.0, lambda n: None).stop()


@pytest.mark.parametrize("period", [0.0, -1.0, float("nan")])
def test_a_period_that_is_none_is_refused(period):
    with pytest.raises(ValueError, match="positive"):
        DeadlineThread(period, lambda n: None)


def test_threads_of_different_phases_wake_at_their_shares_of_the_period_whenever_they_start():
    period, moments = 0.01, {0.0: [], 0.5: [], 0.875: []}
    threads = [
        DeadlineThread(period, lambda n, own=own: own.append(time.monotonic_ns()), phase=phase)
        for phase, own in moments.items()
    ]
    for thread in threads:
        thread.start()
        time.sleep(0.003)
    time.sleep(0.3)
    for thread in threads:
        thread.stop()
    for phase, own in moments.items():
        late = (np.array(own) * 1e-9 / period - phase) % 1.0
        assert np.median(late) < 0.25, phase  # 2.5 ms: it wakes after its moment, never before
