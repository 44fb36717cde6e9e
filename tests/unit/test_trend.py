"""Many recordings of one robot in time: limits that keep their promise, and what is said of a robot."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import t as student
from weekly_recordings import FIRST_WEEK, FRICTION, NEW, WEEK, Ageing, write_week

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_sysid.commands.trend import main
from haptic_teleop_sysid.many.charts import Quantity, chart
from haptic_teleop_sysid.many.folder import Listing, in_order
from haptic_teleop_sysid.many.limits import limits, moving
from haptic_teleop_sysid.many.trend import trend_of
from haptic_teleop_sysid.many.trend_words import change_sentence

REFERENCE, YEAR, ALARM = 12, 52, 0.02


def drawn(random, shift=0.0, kappa=4.0):
    """A year of values with unequal standard errors that understate the scatter by a factor of two."""
    std = 0.1 * random.uniform(0.7, 2.0, REFERENCE + YEAR)
    values = 5.0 + np.sqrt(kappa) * std * random.standard_normal(REFERENCE + YEAR) + shift
    return Quantity("stiffness", "N*m/rad", values, std)


@pytest.mark.parametrize("reference", [5, 12, 30])
def test_the_limit_of_one_recording_is_students(reference):
    """With one recording a year both charts are the same number, and it has Student's distribution."""
    found = limits(reference, 1, 0.05)
    exact = student.ppf(1.0 - 0.05 / 4.0, reference - 1)
    assert found.single == pytest.approx(exact, rel=0.1)
    assert found.moving == pytest.approx(found.single)


def test_a_moving_average_has_a_standard_deviation_of_one():
    scores = np.random.default_rng(1).standard_normal((4000, 40))
    assert np.std(moving(scores), axis=0) == pytest.approx(np.ones(40), abs=0.06)


def test_years_without_change_have_no_more_alarms_than_promised():
    random = np.random.default_rng(2)
    alarms = 0
    for _ in range(1500):
        found = chart(drawn(random), REFERENCE, YEAR, ALARM, 4)
        assert found is not None
        alarms += found.first is not None
    # Binomial of 1500: less than one in a thousand beyond 1500 (0.02 + 3.1 sqrt(0.02 0.98 / 1500)).
    assert alarms <= 47


def test_a_jump_is_told_at_once_and_alone_and_a_creeping_change_before_it_could_jump():
    random = np.random.default_rng(3)
    outlier = np.zeros(REFERENCE + YEAR)
    outlier[30] = 20.0
    jumped = chart(drawn(random, outlier), REFERENCE, YEAR, ALARM, 4)
    assert jumped is not None and np.flatnonzero(jumped.outside).tolist() == [30] and jumped.single[30]
    weeks = np.arange(REFERENCE + YEAR)
    crept = chart(drawn(random, np.where(weeks >= 20, 0.6, 0.0)), REFERENCE, YEAR, ALARM, 4)
    assert crept is not None and crept.first is not None
    assert not crept.single[20 : crept.first + 1].any() and crept.creeping[-1]
    assert 0.05 < crept.change < 0.2  # 0.6 of 5


def test_a_quantity_that_the_reference_does_not_show_is_not_watched():
    values = np.where(np.arange(20) % 3 > 0, np.nan, 1.0)
    assert chart(Quantity("stiffness", "", values, values), REFERENCE, YEAR, ALARM, 4) is None


def test_limits_that_nobody_could_know_are_refused():
    with pytest.raises(ConfigurationError, match="give 5 at least"):
        limits(4, YEAR, ALARM)
    with pytest.raises(ConfigurationError, match="raise --false-alarms"):
        limits(12, YEAR, 1e-5)


def outcome(week, friction=0.3, dated=True, slips=()):
    random = np.random.default_rng(week)
    return {
        "status": "done",
        "start_ns": (FIRST_WEEK if dated else 10**18) + week * WEEK,
        "parameters": {
            FRICTION: {"value": friction + 0.001 * random.standard_normal(), "std": 0.001, "unit": "N*m"}
        },
        "unexplained": 0.01 * np.exp(0.1 * random.standard_normal()),
        "error": {"estimate": 0.03, "given": 0.03 * np.exp(0.1 * random.standard_normal())},
        "fit": {"estimate": {}, "given": {}},
        "slips": [*slips],
        "seconds_long": 6.0,
    }


def test_recordings_are_ordered_by_their_stamps_and_what_has_no_date_is_listed():
    found = {f"{100 - week}": outcome(week, 0.3 if week < 15 else 0.4) for week in range(20)}
    found["200"] = outcome(1, dated=False)
    found["300"] = {"status": "unusable", "message": "damaged"}
    found["400"] = outcome(0)
    told = trend_of(NEW, found, {name: Path(name) for name in found}, 12, 0.05)
    assert [p.name for p in told.points] == ["100", "400", *(str(n) for n in range(99, 80, -1))]
    assert told.year == 52 and [name for name, _ in told.unusable] == ["200", "300"]
    assert "100 and 400 begin at the same instant" in " ".join(told.told)
    assert told.first == 16 and "friction.torque grew by 33" in change_sentence(told)
    found["85"]["error"]["given"] = None
    told = trend_of(NEW, found, {name: Path(name) for name in found}, 12, 0.05)
    assert told.events == {16: ["the simulated response of the model as given runs away"]}
    assert "simulated error, given model is not determined by 1 of the 9" in " ".join(told.told)
    found["90"]["damaged"] = ["it was cut"]
    told = trend_of(NEW, found, {name: Path(name) for name in found}, 12, 0.05)
    assert told.damaged == ["90"] and "90 is broken and used as far as it goes: it was cut" in told.told
    dateless = {name: o | {"start_ns": 10**9} for name, o in found.items() if o["status"] == "done"}
    told = trend_of(NEW, dateless, {name: Path(name) for name in dateless}, 12, 0.05)
    assert [p.name for p in told.points] == sorted(dateless, key=int)
    typed = trend_of(NEW, dateless, {n: Path(n) for n in dateless}, 12, 0.05, listing=Listing((), (), True))
    assert [p.name for p in typed.points] == list(dateless)
    assert "in the order in which they were given" in " ".join(typed.told)
    dated = {name: o for name, o in found.items() if o["status"] == "done" and name not in ("200", "400")}
    typed = trend_of(NEW, dated, {n: Path(n) for n in dated}, 12, 0.05, listing=Listing((), (), True))
    assert "not as given" not in " ".join(typed.told)
    turned = dict(reversed(dated.items()))
    typed = trend_of(NEW, turned, {n: Path(n) for n in turned}, 12, 0.05, listing=Listing((), (), True))
    assert [p.name for p in typed.points] == list(dated)
    assert "in order of their own dates, not as given: 100, 99, 98" in " ".join(typed.told)
    with pytest.raises(ConfigurationError, match=r"22 recordings can be used.*smaller --reference"):
        trend_of(NEW, dateless, {name: Path(name) for name in dateless}, 22, 0.05)


@pytest.mark.long
def test_the_command_names_the_first_that_leaves_and_goes_on_where_it_was(tmp_path, capsys):
    ageing = Ageing(friction=(8, 0.5), slip=7)
    bags, out, model = tmp_path / "bags", tmp_path / "out", tmp_path / "new.yaml"
    for week in range(1, 8):
        write_week(bags, week, ageing=ageing, seconds=3.0)
    NEW.save(model)
    broken = bags / "a_broken_one"
    broken.mkdir()
    (broken / "metadata.yaml").write_text("rosbag2_bagfile_information: [")
    arguments = ["--model", str(model), "--bags", str(bags), "--output", str(out), "--reference", "6"]
    arguments += ["--jobs", "1", "--false-alarms", "0.2"]
    assert main(arguments) == 0
    said = json.loads((out / "trend.json").read_text())
    assert said["first_outside"]["reasons"][0].startswith("stage1_motor_encoder slipped by 0.05 rad")
    assert [u["name"] for u in said["unusable"]] == ["a_broken_one"]
    assert "not used: a_broken_one" in capsys.readouterr().out
    computed = {p: p.stat().st_mtime_ns for p in (out / "recordings").rglob("outcome.json")}
    assert len(computed) == 8
    new = write_week(bags, 8, ageing=ageing, seconds=3.0)
    assert main([*arguments, "--check"]) == 3
    kept = {p: p.stat().st_mtime_ns for p in (out / "recordings").rglob("outcome.json")}
    assert len(kept) == 9 and all(kept[p] == when for p, when in computed.items())
    said = json.loads((out / "trend.json").read_text())
    friction = said["quantities"][FRICTION]
    assert friction["first_outside"] == new.name and friction["now"] > 1.1 * friction["reference"]
    assert [name for name, q in said["quantities"].items() if q["first_outside"] and "error" not in name] == [
        FRICTION
    ]
    assert str(new) in said["first_outside"]["diagnose"][1]
    assert "<svg" in (out / "report.html").read_text() and FRICTION in (out / "trend.csv").read_text()


def test_undated_recordings_are_in_the_order_in_which_people_count():
    names = ["week10.csv", "week2.csv", "b/week1.csv", "week1.csv"]
    assert sorted(names, key=in_order) == ["b/week1.csv", "week1.csv", "week2.csv", "week10.csv"]


def test_what_creeps_is_now_where_the_newest_recording_has_it():
    std = np.full(30, 0.01)
    values = 5.0 + 0.01 * np.random.default_rng(3).standard_normal(30)
    values[15:] += 0.1 * np.arange(1, 16)
    found = chart(Quantity("motor_damping", "N*m*s/rad", values, std), REFERENCE, YEAR, ALARM, 4)
    assert found.now == pytest.approx(values[-1], abs=0.03)
