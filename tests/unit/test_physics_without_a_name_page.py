"""README.md sums up the table of sealed draws of physics without a name on docs/diagnosis_measured.md."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def rows():
    """The draws of the table as numbers: (draws, cases, `unknown`, wrong and sure, right place)."""
    text = (ROOT / "docs" / "diagnosis_measured.md").read_text(encoding="utf-8")
    table = text.split("| answered by |")[1].split("\n\n")[0]
    for line in table.split("\n")[3:]:
        first, _, *cells = (cell.strip(" *") for cell in line.strip("|").split("|"))
        before = re.match(r"(\d+) before", first)
        cases, unknown, wrong, place = (int(re.match(r"\d+", cell).group()) for cell in cells[:4])
        yield int(before.group(1)) if before else 1, cases, unknown, wrong, place


def test_the_readme_states_the_sums_of_the_table_and_its_newest_draw():
    stated = re.search(
        r"(\d+) recordings of (\d+) sealed draws .*? (\d+) times `unknown`, \*\*(\d+) times a wrong name "
        r"with 70 % or more\*\*; the right place (\d+) times \(of the (\d+) newest (\d+), (\d+) and (\d+)\)",
        " ".join((ROOT / "README.md").read_text(encoding="utf-8").split()),
    )
    cases, draws, unknown, wrong, place, *newest = map(int, stated.groups())
    table = list(rows())
    assert [draws, cases, unknown, wrong, place] == [sum(column) for column in zip(*table, strict=True)]
    assert newest == list(table[0][1:])
