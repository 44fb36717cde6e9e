"""docs/first_hour.md and docs/scenario2.md, done literally: what is typed there works and is told as it
comes."""

import contextlib
import io
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
from haptic_teleop_control.recording import read_recording

pytestmark = pytest.mark.no_graph
PAGES = ("first_hour.md", "scenario2.md")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The folder after the commands of both pages that need no ROS, and what they printed.

    They run in this process, which imports and compiles once for all of them.
    """
    folder, said = tmp_path_factory.mktemp("somewhere"), io.StringIO()
    shutil.copytree(DOCS / "examples", folder / "docs" / "examples")
    with contextlib.chdir(folder), contextlib.redirect_stdout(said):
        for page in PAGES:
            for language, file, text in blocks(page):
                if language == "yaml":
                    Path(file).write_text(text, encoding="utf-8")
                elif language == "bash" and file != "ros":
                    for line in text.replace("\\\n", " ").splitlines():
                        program, name, *arguments = shlex.split(line)
                        assert (program, load(name)(arguments)) == ("haptic-teleop", 0), line
    return folder, said.getvalue()


def test_the_diagnosis_names_the_play_and_its_width(folder):
    found = json.loads((folder[0] / "diagnosis" / "diagnosis.json").read_text())
    assert found["verdict"] == "identified"
    (named,) = found["findings"]
    assert (named["effect"], named["location"]) == ("backlash", "stage2_joint")
    # What was hidden; test_bring_your_own_robot.py draws the case and compares.
    assert named["parameters"]["width"]["value"] == pytest.approx(0.002986, rel=0.05)


def test_the_page_states_what_comes_out(folder):
    page = (DOCS / "first_hour.md").read_text(encoding="utf-8")
    found = json.loads((folder[0] / "diagnosis" / "diagnosis.json").read_text())
    value, std = map(float, re.search(r"width ([\d.]+) ± ([\d.e-]+) rad", page).groups())
    assert found["findings"][0]["parameters"]["width"]["value"] == pytest.approx(value, abs=0.3 * std)
    shown = re.search(r"\((\d+) %\): width", page)[1]
    told = re.search(r"confidence is (\d+) %, just too little", page)[1]
    assert shown == told == f"{100.0 * found['findings'][0]['confidence']:.0f}"
    assert int(told) < 70
    assert found["adequacy"]["free_run"] == pytest.approx(0.9, abs=0.02)
    stated = re.search(r"velocity is (\d+), (\d+) and (\d+) %", " ".join(page.split())).groups()
    fits = [found["fit"][m]["validation"]["stage2_arm.velocity"] for m in ("given", "baseline", "augmented")]
    assert fits == pytest.approx([float(s) for s in stated], abs=1.5)


def test_the_augmented_model_runs_in_the_scenario_of_the_page(folder):
    states = read_recording(folder[0] / "recordings" / "with_backlash").topics["/sfj/joint_states"]
    last = (states.time() > 10.0) & (states.time() < 13.0)
    # Pressing with 0.08 rad x 10 N·m/rad against a wall at 1 rad, backlash or not.
    assert states.signal("stage2_arm", "effort")[last].mean() == pytest.approx(0.8, rel=0.05)
    assert states.signal("stage2_arm", "position")[last].mean() == pytest.approx(1.0, abs=0.01)
    assert "stage2: -0.08 to 0.08 rad, from 4 s" in folder[1]


def test_the_omni_presses_with_what_the_hands_ask_for(folder):
    topics = read_recording(folder[0] / "recordings" / "hand").topics
    names = ("/sfj/joint_states", "/omni/joint_states", "/omni/effort_command")
    arms, omni, asked = (topics[name] for name in names)
    for stage, axis in (("stage1", "omni_y"), ("stage2", "omni_z")):
        held = [(series.time() > 3.0) & (series.time() < 5.0) for series in (arms, omni, asked)]
        hand = abs(arms.signal(f"{stage}_arm", "effort")[held[0]].mean())
        # The page's sum: gain 0.2, dead zone 0.02 N·m. The surface lies at 0.4 rad.
        pressed = abs(asked.signal(axis, "effort")[held[2]].mean())
        assert pressed == pytest.approx(0.2 * (hand - 0.02), abs=1e-3)
        assert hand == pytest.approx(0.62, abs=0.03)
        assert abs(omni.signal(axis, "position")[held[1]]).min() > 0.4
