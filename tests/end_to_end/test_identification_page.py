"""docs/identification.md, done literally: its commands run, and what they give is what the page states."""

import contextlib
import json
import re
import shlex
import shutil
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from pages import DOCS, blocks

from haptic_teleop_control.front_door import load

pytestmark = [pytest.mark.no_graph, pytest.mark.long]
PAGE = "identification.md"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The folder after the page's commands, which run in this process."""
    folder = tmp_path_factory.mktemp("top")
    shutil.copytree(DOCS / "examples", folder / "docs" / "examples")
    shutil.copytree(DOCS.parent / "config", folder / "config")
    (commands,) = [text for language, _, text in blocks(PAGE) if language == "bash"]
    with contextlib.chdir(folder):
        for line in commands.replace("\\\n", " ").splitlines():
            program, name, *arguments = shlex.split(line)
            assert (program, load(name)(arguments)) == ("haptic-teleop", 0), line
    return folder


def rows(first):
    """The cells of the rows of the page's table that begins with that cell."""
    page = (DOCS / PAGE).read_text(encoding="utf-8")
    table = page[page.index(f"| {first} |") :].split("\n\n")[0].splitlines()[2:]
    return [[cell.strip() for cell in row.strip("|").split("|")] for row in table]


@pytest.mark.parametrize(("model", "column"), [("with", 3), ("without", 5)])
def test_the_estimates_and_their_errors_are_those_of_the_page(folder, model, column):
    listed = json.loads((folder / model / "estimate.json").read_text())["parameters"]
    found = {entry["name"]: entry for entry in listed}
    for cells in rows("parameter"):
        name = cells[0].partition(",")[0]
        name = {"coulomb_friction": "stage1_motor.coulomb_friction.torque"}.get(name, name)
        stated, wide = cells[column : column + 2]
        if stated == "–":
            assert name not in found
            continue
        value, error = found[name]["value"], found[name]["std"]
        assert value == pytest.approx(float(stated), abs=10.0 ** -len(stated.partition(".")[2]))
        assert found[name]["at_least"] is (model == "without")
        if wide != "–":  # nothing is printed where it would claim more digits than mean anything
            assert error < float(wide[1:]) if wide[0] == "<" else error == pytest.approx(float(wide), rel=0.2)


def test_the_fits_are_those_of_the_page(folder):
    found = json.loads((folder / "compared" / "compare.json").read_text())["fits"]
    for name, *cells in rows("fit on `stage1_check`, 20 to 32 s"):
        fits = found[f"{name.removesuffix(' friction')}/model.yaml"]["recordings/stage1_check"]
        assert list(fits.values()) == pytest.approx([float(cell.split()[0]) for cell in cells], abs=0.3)


def test_the_condition_is_that_of_the_page(folder):
    page = (DOCS / PAGE).read_text(encoding="utf-8")
    stated = float(re.search(r"by\s+a\s+quick\s+fit,\s+is ([\d.e]+)", page)[1])
    found = json.loads((folder / "look" / "dataset.json").read_text())["recordings"][0]
    assert found["condition"] == pytest.approx(stated, rel=0.03)
