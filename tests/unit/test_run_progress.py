"""What a long run says of itself: elapsed and expected time, on a terminal and in a pipe."""

import io
import re
import threading
from contextlib import contextmanager

import pytest
from identification_plants import STAGE, stage_recording
from rich.console import Console

from haptic_teleop_sysid import run_progress
from haptic_teleop_sysid import spread as spread_module
from haptic_teleop_sysid.blind import forked
from haptic_teleop_sysid.blind.forked import run_forked
from haptic_teleop_sysid.diagnosis.report.forecast import (
    BASELINE,
    REST,
    ROUND,
    DiagnosisForecast,
    pass_seconds,
)
from haptic_teleop_sysid.diagnosis.usable import records_of
from haptic_teleop_sysid.recordings.dataset import load_dataset
from haptic_teleop_sysid.run_progress import OFTEN, SELDOM, RunProgress, share_progress
from haptic_teleop_sysid.spread import spread


class Clock:
    """A clock that is set by hand."""

    now = 0.0

    def __call__(self):
        return self.now


def test_a_line_holds_elapsed_and_expected_time_and_the_step():
    clock, forecast = Clock(), DiagnosisForecast()
    progress = RunProgress(Console(file=io.StringIO()), "diagnose", forecast, clock)
    progress.say("reading recordings")
    clock.now = 1.0
    assert progress.line() == "diagnose: 0:01 min: reading recordings"
    forecast.unit = 0.01
    progress.say("effect 1: screening all effects")
    clock.now = 65.0
    told = re.fullmatch(r"diagnose: 1:05 of about (\d+):(\d\d) min or more: effect 1: .*", progress.line())
    assert 60 * int(told.group(1)) + int(told.group(2)) > 65.0


class Paper(io.StringIO):
    """What is written on, and an event when three lines are."""

    def __init__(self):
        super().__init__()
        self.full = threading.Event()

    def write(self, text):
        count = super().write(text)
        if self.getvalue().count("\n") >= 3:
            self.full.set()
        return count


def test_without_a_terminal_a_line_comes_now_and_then_even_within_one_step(monkeypatch):
    monkeypatch.setattr(run_progress, "OFTEN", 0.02)
    paper = Paper()
    with RunProgress(Console(file=paper), "diagnose", DiagnosisForecast()) as progress:
        progress.say("reading recordings")
        assert paper.full.wait(20.0)
    lines = paper.getvalue().splitlines()
    assert all(re.fullmatch(r"diagnose: \d+:\d\d min: reading recordings", line) for line in lines)
    assert not progress._thread.is_alive()


def test_lines_are_ten_seconds_apart_at_first_and_at_most_thirty_later():
    clock = Clock()
    progress = RunProgress(Console(file=io.StringIO()), "diagnose", DiagnosisForecast(), clock)
    assert progress._pause() == OFTEN == 10.0
    clock.now = 300.0
    assert progress._pause() == SELDOM == 30.0


def test_on_a_terminal_the_status_is_alive(monkeypatch):
    monkeypatch.setattr(run_progress, "LIVE", 0.02)
    screen = io.StringIO()
    console = Console(file=screen, force_terminal=True, width=120)
    with RunProgress(console, "diagnose", DiagnosisForecast()) as progress:
        progress.say("doubting")
        for _ in range(500):
            if "doubting" in screen.getvalue():
                break
            threading.Event().wait(0.02)
    assert "doubting" in screen.getvalue()


def total(*steps, at, unit=0.01, nulls=0):
    """The forecast at a time after steps that began at some."""
    forecast = DiagnosisForecast(nulls, 2, unit)
    for text, when in steps:
        forecast.step(text, when)
    return forecast.total(at)


START = (("reading recordings", 0.0), ("re-estimating the given structure", 1.0))
SEARCH = (*START, ("effect 1: screening all effects", 3.0))


def test_nothing_is_expected_before_something_was_measured():
    assert total(*SEARCH, at=3.0, unit=None) is None


def test_a_machine_that_is_twice_as_slow_needs_twice_as_long():
    assert total(*START, at=1.0) == pytest.approx(1.0 + 0.01 * (BASELINE + ROUND + REST))
    assert total(*SEARCH, at=3.0) == pytest.approx(3.0 + 0.01 * (ROUND + REST))
    assert total(*SEARCH, at=3.0, unit=0.02) == pytest.approx(3.0 + 0.02 * (ROUND + REST))


def test_what_takes_longer_than_thought_moves_the_end():
    late = 3.0 + 10.0 * ROUND * 0.01
    assert total(*SEARCH, at=late) > late
    assert total(*SEARCH, at=late) > total(*SEARCH, at=3.0)


def test_a_further_round_takes_about_what_the_last_one_took_and_the_rest_goes_at_that_pace():
    took = 2.0 * ROUND * 0.01
    end = 3.0 + took
    steps = (*SEARCH, ("effect 1: judging", 4.0), ("effect 2: screening all effects", end))
    assert total(*steps, at=end) == pytest.approx(end + took + 2.0 * REST * 0.01)
    # Steps that no phase begins with change nothing.
    assert total(*steps, ("another step", end), at=end) == total(*steps, at=end)


def test_nulls_to_come_are_counted():
    more = total(*SEARCH, at=3.0, nulls=4) - total(*SEARCH, at=3.0)
    assert more == pytest.approx(4 / 2 * 0.01 * (BASELINE + ROUND + REST))


def test_the_end_is_never_behind_what_has_passed():
    steps = [*SEARCH, ("searching by free simulation", 9.0), ("effect 1, freely running: fitting", 11.0)]
    steps += [("doubting", 30.0), ("writing the report", 31.0)]
    for k in range(1, len(steps) + 1):
        for late in (0.0, 5.0, 500.0):
            now = steps[k - 1][1] + late
            assert total(*steps[:k], at=now) >= now


def test_a_pass_over_four_times_the_samples_takes_longer():
    short, long = (records_of([load_dataset(stage_recording(seed=1, seconds=s), STAGE)]) for s in (4.0, 16.0))
    assert 0.0 < min(pass_seconds(STAGE, short) for _ in range(3)) < pass_seconds(STAGE, long)


def test_a_fork_s_lines_are_passed_on_while_it_runs():
    told = []
    status, words = run_forked("diagnose", ["--no-such-option"], 120.0, told.append)
    assert status == "2"
    assert words == told[-1:]
    assert "--no-such-option" in words[0]
    assert run_forked("diagnose", ["--no-such-option"], 120.0) == (status, words)


def test_the_lines_of_a_fork_that_ends_before_the_first_look_are_passed_on(monkeypatch):
    process = forked._SERVER.Process
    start = process.start
    monkeypatch.setattr(process, "start", lambda self: (start(self), self.join()))
    told = []
    status, words = run_forked("diagnose", ["--no-such-option"], 120.0, told.append)
    assert (status, words) == ("2", told[-1:]) and words


def test_a_share_that_is_done_tells_how_long_all_takes(monkeypatch):
    monkeypatch.setattr(run_progress, "OFTEN", 0.02)
    paper = Paper()
    with share_progress(Console(file=paper), "generating") as tell:
        tell("75 of 300", 0.25)
        assert paper.full.wait(20.0)
    seconds = [
        re.fullmatch(r"generating: 0:(\d\d) of about 0:(\d\d) min: 75 of 300", one).groups()
        for one in paper.getvalue().splitlines()
    ]
    assert all(3 * int(elapsed) <= int(total) <= 4 * int(elapsed) + 4 for elapsed, total in seconds)


def test_many_things_tell_how_many_are_done(monkeypatch):
    told = []

    @contextmanager
    def noting(console, name):
        yield lambda text, share: told.append((name, text, share))

    monkeypatch.setattr(spread_module, "share_progress", noting)
    results = spread(lambda n: n, [(n,) for n in range(4)], 1, None, "sorting", threads=True)
    assert results == [0, 1, 2, 3]
    assert told == [("sorting", f"{n} of 4", n / 4) for n in range(5)]
