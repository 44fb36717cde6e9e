"""docs/how_to_write_a_controller.md, done literally in an empty folder: files written, commands run."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from pages import blocks, environment, run

from haptic_teleop_control.recording import read_recording

PAGE = "how_to_write_a_controller.md"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The folder after every block that needs no ROS has been done, in the page's order."""
    folder = tmp_path_factory.mktemp("somewhere")
    for language, file, text in blocks(PAGE):
        if file:
            (folder / file).write_text(text, encoding="utf-8")
        if language == "bash" and "scenario my" not in text and "verify" not in text:
            run(text, folder)
    return folder


def test_the_page_has_a_law_a_scenario_and_commands():
    assert [(language, file) for language, file, _ in blocks(PAGE)] == [
        ("python", "my_law.py"), ("yaml", "my_scenario.yaml"), ("bash", ""), ("python", "try_gains.py"),
        ("bash", ""), ("bash", ""),
    ]  # fmt: skip


def test_the_law_presses_against_the_wall_and_its_parameters_are_recorded(folder):
    recording = read_recording(folder / "recordings" / "mine")
    assert recording.parameters["/force_controller"]["law"] == "my_law:MyLaw"
    assert recording.parameters["/force_controller"]["stage1.my.gain"] == 1.5
    states = recording.topics["/sfj/joint_states"]
    last = states.time() > 7.0
    assert states.signal("stage1_arm", "effort")[last].mean() == pytest.approx(0.6, rel=0.05)
    assert states.signal("stage2_arm", "effort")[last].mean() == pytest.approx(0.8, rel=0.05)


def test_the_loop_over_gains_prints_a_line_for_each(folder):
    lines = run(f"{sys.executable} try_gains.py", folder).splitlines()
    assert [line.split(":")[0] for line in lines] == ["gain 0.8", "gain 1.5", "gain 3.0"]


@pytest.mark.parametrize(
    ("command", "line", "told"),
    [
        (
            "lockstep",
            "my.gian: 1.5",
            "stage1.my.gian is not a parameter of this node; did you mean stage1.my.gain?",
        ),
        ("scenario", "my.gain: -1.5", "stage1.my.gain is -1.5 A/(N·m); choose 0 <= value"),
    ],
)
def test_a_mistake_in_its_parameters_is_told_in_a_sentence(folder, command, line, told):
    wrong = (folder / "my_scenario.yaml").read_text().replace("stage1.my.gain: 1.5", f"stage1.{line}")
    (folder / "wrong.yaml").write_text(wrong)
    if command == "scenario":
        pytest.importorskip("rclpy", reason="needs ROS 2: `make setup`, or source an installation")
    done = subprocess.run(
        ["haptic-teleop", command, "wrong.yaml"], cwd=folder, env=environment(), capture_output=True,
        text=True, timeout=100, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert "wrong.yaml" in done.stderr and told in done.stderr


@pytest.mark.long
@pytest.mark.timeout(800)
def test_the_graph_runs_the_law_and_verify_compares_all_three(folder):
    pytest.importorskip("rclpy", reason="needs ROS 2: `make setup`, or source an installation")
    for language, _, text in blocks(PAGE):
        if language == "bash" and ("scenario my" in text or "verify" in text):
            run(text, folder)
    result = json.loads((folder / "reports" / "comparison" / "verify.json").read_text())
    mine, graph, thesis = (f"recordings/{name}" for name in ("mine", "mine_in_the_graph", "thesis"))
    assert list(result["runs"]) == [mine, graph, thesis]
    for run_ in (mine, graph):
        assert result["simulation"][run_]["fit_percent"]["stage 1"]["arm position"] == pytest.approx(100.0)
    ours, theirs = (read_recording(folder / name).topics for name in (mine, graph))
    for topic in ("/sfj/joint_states", "/omni/joint_states", "/sfj/effort_command", "/omni/effort_command"):
        assert np.array_equal(ours[topic].stamp, theirs[topic].stamp)
        assert np.array_equal(ours[topic].effort, theirs[topic].effort)
    assert (folder / "reports" / "comparison" / "report.html").stat().st_size > 100_000
