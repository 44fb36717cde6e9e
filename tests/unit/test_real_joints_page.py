"""docs/real_joints.csv: its rows add up to the totals that pages state, and follow the page's rule."""

import csv
import re
from collections import Counter
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"
TOTAL = re.compile(r"(\d+) right, (\d+) in part, (\d+) open, (\d+) wrong(?:,| and) (\d+) missed")


@pytest.fixture(scope="module")
def rows():
    with (DOCS / "real_joints.csv").open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


@pytest.mark.parametrize("page", ["real_joints.md", "diagnosis_measured.md"])
def test_the_totals_on_a_page_are_those_of_the_rows(rows, page):
    judged = Counter(row["judged"] for row in rows)
    text = " ".join((DOCS / page).read_text(encoding="utf-8").split())
    found = TOTAL.search(text)
    assert [int(n) for n in found.groups()] == [
        judged[word] for word in ("right", "in part", "open", "wrong", "missed")
    ]
    assert f"{len(rows)} cases" in text


def test_the_readme_states_the_same_totals(rows):
    judged = Counter(row["judged"] for row in rows)
    text = " ".join((DOCS.parent / "README.md").read_text(encoding="utf-8").split())
    found = re.search(
        r"\[(\d+) cases of real joints\]\S+ (\d+) right, (\d+) in part, (\d+) that the recording leaves "
        r"open, \*\*(\d+) wrong, (\d+) missed",
        text,
    )
    words = ("right", "in part", "open", "wrong", "missed")
    assert [int(n) for n in found.groups()] == [len(rows), *(judged[word] for word in words)]


def test_an_answer_with_a_wrong_finding_is_judged_wrong_and_no_other_is(rows):
    assert {r["joint"] for r in rows if "WRONG" in r["answer"]} == {
        r["joint"] for r in rows if r["judged"] == "wrong"
    }


def test_each_wrong_answer_with_70_percent_or_more_stands_on_the_page(rows):
    text = (DOCS / "real_joints.md").read_text(encoding="utf-8")
    table = text.split("\n## Wrong\n")[1].split("\n## Missed\n")[0]
    on_the_page = re.findall(r"^\| (?!joint \|)(.*?) \| ", table, re.M)
    certain = [
        row["joint"]
        for row in rows
        if any(int(n) >= 70 for n in re.findall(r"(\d+) %", row["answer"].partition("WRONG")[2]))
    ]
    assert sorted(joint.split(",")[0] for joint in on_the_page) == sorted(j.split(",")[0] for j in certain)
    wrong = [row for row in rows if row["judged"] == "wrong"]
    assert f"the other {len(wrong) - len(certain)} are in the [CSV]" in " ".join(text.split())


def sure(answer):
    """Whether some name of an answer has 70 % or more; every "(95 %" is a confidence."""
    return any(int(n) >= 70 for n in re.findall(r"(\d+) %", answer))


@pytest.mark.parametrize("page", ["README.md", "docs/diagnosis.md", "docs/diagnosis_measured.md"])
def test_a_page_states_how_often_a_name_of_70_percent_or_more_is_wrong(rows, page):
    text = " ".join((DOCS.parent / page).read_text(encoding="utf-8").split())
    given, wrong = re.search(
        r"the \[?(\d+) answers that give a name 70 % or more\S*, (?:\*\*)?(\d+) give it to a wrong one", text
    ).groups()
    assert int(given) == sum(sure(row["answer"]) for row in rows)
    assert int(wrong) == sum(sure(row["answer"].partition("WRONG")[2]) for row in rows)


def test_the_page_of_cases_states_it_of_all_and_of_the_newest(rows):
    text = " ".join((DOCS / "real_joints.md").read_text(encoding="utf-8").split())
    numbers = re.search(
        r"(\d+) first answers give a name 70 % or more, and (\d+) of them give it to a wrong one; of the "
        r"(\d+) newest these are (\d+) and (\d+)",
        text,
    )
    given, wrong, newest, given_newest, wrong_newest = map(int, numbers.groups())
    for some, stated in ((rows, (given, wrong)), (rows[:newest], (given_newest, wrong_newest))):
        found = [
            sum(sure(answer) for answer in answers)
            for answers in (
                [row["answer"] for row in some],
                [row["answer"].partition("WRONG")[2] for row in some],
            )
        ]
        assert tuple(found) == stated


def test_rows_are_in_order_of_their_dates_newest_first(rows):
    dates = [row["date"] for row in rows]
    assert dates == sorted(dates, reverse=True)


def test_no_row_has_more_fields_than_the_header(rows):
    """An answer with commas and without quotes was cut at the first one."""
    assert [row["number"] for row in rows if None in row or None in row.values()] == []


def test_rows_keep_their_numbers_when_newer_ones_come(rows):
    assert [int(row["number"]) for row in rows] == list(range(len(rows), 0, -1))
