"""What `trend` flags in a year in which a robot grows old, and how often in years in which it does not: the
figures of docs/many_recordings.md.

    python tests/studies/trend_year.py FOLDER [--aged A] [--clean N] [--years Y] [--jobs J]
    python tests/studies/trend_year.py FOLDER --picture docs/many_recordings.png    # the picture alone

The year: friction grows by 1.5 % a week from week 18 on, a belt softens by 1 % a week from week 30 on, the
motor's encoder slips once, in week 40. Friction and damping also differ by 1 % (rms) from week to week, as
they do with the temperature, and a random torque acts. The clean years are drawn without replacement from N
clean recordings, each simulated by itself; that two years share recordings makes them no less clean. What was
done is kept in FOLDER.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from haptic_teleop_sysid.commands.trend import main as trend
from haptic_teleop_sysid.many.characterise import characterise
from haptic_teleop_sysid.many.each import Job, Means, each
from haptic_teleop_sysid.many.kept import DONE
from haptic_teleop_sysid.many.trend import GIVEN_ERROR, UNEXPLAINED, Trend, trend_of
from haptic_teleop_sysid.many.trend_picture import charts_plot
from haptic_teleop_sysid.report import save_png
from haptic_teleop_sysid.runs.estimation_run import Choices

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "unit"))
from weekly_recordings import FIRST_WEEK, FRICTION, NEW, WEEK, Ageing, write_week

AGEING = Ageing(friction=(18, 0.015), stiffness=(30, -0.01), slip=40)
WEEKS, REFERENCE = 52, 12
SHOWN = (FRICTION, "stiffness", "motor_damping", UNEXPLAINED, GIVEN_ERROR)
"""The charts of the picture."""


def recording(week: int, seed: int, ageing: Ageing | None, folder: Path) -> dict[str, Any]:
    """Write one recording, characterise it, and delete it."""
    bag = write_week(folder, week, seed, ageing)
    try:
        return characterise(str(bag), NEW, Choices(allow_gaps=True))
    finally:
        for part in bag.iterdir():
            part.unlink()
        bag.rmdir()


def ageing(seed: int, folder: Path, jobs: int) -> Trend:
    """Return the trend of an ageing robot."""
    weeks = [
        Job(f"{w:02d}", folder / f"{w:02d}", (), recording, (w, seed, AGEING), (NEW, w, seed, AGEING))
        for w in range(1, WEEKS + 1)
    ]
    outcomes, _ = each(f"ageing robot {seed}", weeks, Means(jobs))
    return trend_of(NEW, outcomes, {name: Path(name) for name in outcomes}, REFERENCE, 0.05)


def aged(told: Trend) -> dict[str, Any]:
    """Return the week in which each chart of an ageing robot first leaves its limits, by name."""
    first = {c.quantity.name: told.points[c.first].name for c in told.charts if c.first is not None}
    return first | {"slip": [told.points[i].name for i in told.events]}


def false_alarms(outcomes: list[dict[str, Any]], years: int, after: int, alarms: float) -> Counter[str]:
    """Return how many of the years have an alarm, by chart, and "any". A year is REFERENCE recordings and
    ``after`` more."""
    random = np.random.default_rng(1)
    found: Counter[str] = Counter()
    for _ in range(years):
        drawn = random.permutation(len(outcomes))[: REFERENCE + after]
        year = {
            f"{week:02d}": outcomes[i] | {"start_ns": FIRST_WEEK + week * WEEK}
            for week, i in enumerate(drawn)
        }
        told = trend_of(NEW, year, {name: Path(name) for name in year}, REFERENCE, alarms)
        found.update(c.quantity.name for c in told.charts if c.first is not None)
        found["any"] += told.first is not None
        found["slip"] += any(i >= REFERENCE for i in told.events)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--aged", type=int, default=5)
    parser.add_argument("--clean", type=int, default=1000)
    parser.add_argument("--years", type=int, default=2000)
    parser.add_argument("--jobs", type=int, default=-1)
    parser.add_argument("--picture", type=Path, metavar="PNG", help="draw the first robot, and do no more")
    arguments = parser.parse_args()
    folder: Path = arguments.folder.resolve()
    if arguments.picture is not None:
        first = ageing(1, folder / "aged1", arguments.jobs)
        shown = tuple(c for c in first.charts if c.quantity.name in SHOWN)
        save_png(charts_plot(replace(first, charts=shown)), arguments.picture)
        return
    bags = folder / "year"
    if not bags.exists():
        for week in range(1, WEEKS + 1):
            write_week(bags, week, seed=1, ageing=AGEING)
    NEW.save(folder / "new.yaml")
    trend(["--model", str(folder / "new.yaml"), "--bags", str(bags), "--output", str(folder / "trend")])
    for seed in range(2, 2 + arguments.aged):
        print(f"robot {seed}: {aged(ageing(seed, folder / f'aged{seed}', arguments.jobs))}")
    jobs = [
        Job(f"{n:04d}", folder / "clean" / f"{n:04d}", (), recording, (n, 7, None), (NEW, n))
        for n in range(arguments.clean)
    ]
    outcomes, _ = each("clean recordings", jobs, Means(arguments.jobs))
    usable = [o for o in outcomes.values() if o["status"] == DONE]
    lost = [o["message"] for o in outcomes.values() if o["status"] != DONE]
    print(f"{len(usable)} clean recordings, {len(lost)} without a result: {lost[:3]}")
    for alarms in (0.05, 0.2, 0.5):
        found = false_alarms(usable, arguments.years, WEEKS, alarms)
        print(f"promised {alarms:g} a year: {dict(found)} of {arguments.years} years")


if __name__ == "__main__":
    main()
