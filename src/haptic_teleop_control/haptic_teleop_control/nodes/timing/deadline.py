"""Periodic work paced by absolute deadlines, and the real-time scheduling class.

A timer of the executor does not hold 1 kHz, and sleeping for a period after each cycle drifts by the
time the work takes. Here cycle k is due at `start + k * period`; what is late is run at once, what was missed
altogether is skipped and counted, so that a stall is never followed by a burst.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable

from haptic_teleop_control.clocks import Clock, SteadyClock

NANOSECONDS = 1_000_000_000


class DeadlineThread:
    """Calls `work(periods)` once per period in a thread of its own.

    `periods` is the number of periods since the last call: 1, or more after a stall, so that a simulation can
    keep up with the clock. `cycles`, `overruns` (periods skipped) and `worst_lateness` (s) may be read from
    any thread. An exception in `work` ends the thread and is handed to `on_failure`.

    `phase`: deadlines lie at this share of a period, 0 to 1, counted by the steady clock, which all processes
    of a machine share. Threads of commensurable rates with different phases then never wake at the same
    moment to wait for each other; without a phase the start decides, and they may collide in every cycle.

    `clock`: by which the deadlines count; the steady one where it is None.

    Raises ValueError when `period` (s) is not positive.
    """

    def __init__(
        self,
        period: float,
        work: Callable[[int], None],
        name: str = "deadline",
        on_failure: Callable[[BaseException], None] | None = None,
        realtime_priority: int = 0,
        phase: float | None = None,
        clock: Clock | None = None,
    ) -> None:
        if not period > 0.0:
            raise ValueError(f"period is {period}; give a positive number of seconds")
        self.period_ns = round(period * NANOSECONDS)
        self.cycles = 0
        self.overruns = 0
        self.worst_lateness = 0.0
        self._work = work
        self._on_failure = on_failure
        self._priority = realtime_priority
        self._clock = clock or SteadyClock()
        self._phase_ns = None if phase is None else round(phase * self.period_ns)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self, timeout: float = 1.0) -> bool:
        """Ends the loop after the cycle under way; True when the thread has ended within `timeout`
        seconds."""
        self._stop.set()  # before the start as well: the thread then ends at once
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(timeout)
        return not self._thread.is_alive()

    @property
    def alive(self) -> bool:
        return self._thread.is_alive()

    def _run(self) -> None:
        if self._priority:
            request_realtime(self._priority, [threading.get_native_id()])
        try:
            self._loop()
        except Exception as failure:
            if self._on_failure is None:
                raise
            self._on_failure(failure)

    def _loop(self) -> None:
        period = self.period_ns
        work, stopped = self._work, self._stop.is_set
        now, sleep_until = self._clock.now, self._clock.sleep_until
        deadline = now() + period
        if self._phase_ns is not None:
            deadline -= (deadline - self._phase_ns) % period
        last = deadline - period
        while not stopped():
            if deadline > now():
                sleep_until(deadline)
                if stopped():
                    return
            late = now() - deadline
            if late >= period:  # whole periods went by: go on with the latest one that is due
                missed = late // period
                self.overruns += missed
                deadline += missed * period
            if late * 1e-9 > self.worst_lateness:
                self.worst_lateness = late * 1e-9
            work((deadline - last) // period)
            self.cycles += 1
            last = deadline
            deadline += period


def request_realtime(priority: int, threads: list[int] | None = None) -> bool:
    """Puts threads (default: all of this process) into SCHED_FIFO at `priority` (1..99).

    Returns False, after one line on standard error that says what to do, where the system does not permit it;
    the program then goes on in the normal scheduling class.
    """
    try:
        for thread in threads or [int(entry) for entry in os.listdir("/proc/self/task")]:
            os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(priority))
    except (OSError, AttributeError) as refusal:
        print(
            f"WARNING: no real-time scheduling (SCHED_FIFO {priority}): {refusal}. Samples may be late under "
            "load; allow it with 'ulimit -r 99' (limits.conf: rtprio) or set realtime_priority to 0",
            file=sys.stderr,
            flush=True,
        )
        return False
    return True
