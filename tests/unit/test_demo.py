"""The demo around its scenario: where things go, what it prints, and the exit status when the graph did not
hold.

The scenario itself is replaced by a recording made from formulas; tests/end_to_end runs the real one.
"""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
from scenario_recordings import Made, scenario

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.recording import write_recording
from haptic_teleop_sysid.commands import demo


@pytest.fixture
def pretend(monkeypatch):
    """Let the scenario leave a given recording (None: nothing) and end with a given status."""

    factors = []

    def install(recording, status=0):
        def run(scenario_file, directory, duration, factor):
            assert scenario_file.is_file()
            factors.append(factor)
            if recording is not None:
                write_recording(directory, recording.topics, recording.parameters, recording.experiment)
            return status

        monkeypatch.setattr(demo, "run_scenario", run)
        return factors

    return install


def start(tmp_path, duration="10", *options):
    return demo.main(["--output", str(tmp_path / "demo"), "--duration", duration, *options])


def test_the_scenario_does_not_outlive_who_began_it_however_that_ends(tmp_path):
    nodes = tmp_path / "nodes"
    nodes.write_text(
        f"#!/bin/sh\necho $$ > {tmp_path}/started\nmv {tmp_path}/started {tmp_path}/pid\nexec sleep 60\n"
    )
    nodes.chmod(0o755)
    program = (
        "import sys; from pathlib import Path; from haptic_teleop_sysid.commands import demo\n"
        f"sys.executable = {str(nodes)!r}; demo.run_scenario(Path('none.yaml'), Path('none'), 1.0)"
    )
    with subprocess.Popen([sys.executable, "-c", program]) as parent:
        while not (tmp_path / "pid").exists():
            assert parent.poll() is None
            time.sleep(0.02)
        child = int((tmp_path / "pid").read_text())
        parent.kill()
    try:
        while not _ended(child):
            time.sleep(0.02)
    finally:
        if not _ended(child):
            os.kill(child, signal.SIGKILL)


def _ended(process):
    """Whether it is gone, or waits only for somebody to ask after it."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except OSError:
        return True


def test_a_good_run_prints_five_figures_and_the_report(tmp_path, pretend, capsys):
    pretend(scenario(Made()))
    assert start(tmp_path) == 0
    printed = capsys.readouterr().out
    for label in ("free speed, stage 1", "contact torque, stage 2", "loop latency, median"):
        assert label in printed
    assert "1.14 rad/s" in printed
    assert f"report: {tmp_path / 'demo' / 'report.html'}" in printed
    assert (tmp_path / "demo" / "report.html").exists()
    assert (tmp_path / "demo" / "recording" / "metadata.yaml").exists()


@pytest.mark.usefixtures("unillustrated")
def test_a_second_run_leaves_the_first_alone(tmp_path, pretend):
    pretend(scenario(Made()))
    assert start(tmp_path) == 0
    first = (tmp_path / "demo" / "verify.json").read_text()
    pretend(scenario(Made(droop=0.2)))
    assert start(tmp_path) == 0
    assert (tmp_path / "demo" / "verify.json").read_text() == first
    content = json.loads((tmp_path / "demo-2" / "verify.json").read_text())
    (run,) = content["runs"].values()
    assert run["stages"]["stage1"]["free"][0]["error_percent"] == pytest.approx(-20.0, abs=0.5)


@pytest.mark.usefixtures("unillustrated")
@pytest.mark.parametrize("status", [1, 2, 130])
def test_a_failed_scenario_gives_its_status_even_with_a_fine_recording(tmp_path, pretend, capsys, status):
    pretend(scenario(Made()), status)
    assert start(tmp_path) == status
    assert str(status) in capsys.readouterr().err


def test_a_scenario_that_recorded_nothing_is_a_failure(tmp_path, pretend, capsys):
    pretend(None, 0)
    assert start(tmp_path) == 1
    assert "recorded nothing" in capsys.readouterr().err


@pytest.mark.usefixtures("unillustrated")
def test_a_graph_that_ended_early_is_a_failure(tmp_path, pretend, capsys):
    pretend(scenario(Made(duration=10.0)))
    assert start(tmp_path, duration="20") == 1
    assert "cover 10.0 s of 20 s" in capsys.readouterr().err


@pytest.mark.usefixtures("unillustrated")
@pytest.mark.parametrize("silence", [(0, 2000), (2000, 4500), (3000, 5000)])
def test_a_controller_that_does_not_answer_for_long_is_a_failure(tmp_path, pretend, capsys, silence):
    pretend(scenario(Made(unanswered=tuple(range(*silence)))))
    assert start(tmp_path) == 1
    assert "answered" in capsys.readouterr().err


@pytest.mark.usefixtures("unillustrated")
def test_a_controller_that_never_answered_is_a_failure(tmp_path, pretend, capsys):
    recording = scenario(Made())
    commands = recording.topics["/sfj/effort_command"]
    late = replace(commands, stamp=commands.stamp + 777)
    recording.topics["/sfj/effort_command"] = late
    pretend(recording)
    assert start(tmp_path) == 1
    assert "never answered" in capsys.readouterr().err


def test_the_projects_scenario_is_found_and_an_absent_one_is_asked_for():
    assert demo.find_scenario().name == "scenario1_sim.yaml"
    with pytest.raises(ConfigurationError, match=r"nothing\.yaml.*--scenario"):
        demo.find_scenario("nothing.yaml")


@pytest.mark.usefixtures("unillustrated")
def test_the_real_time_factor_is_passed_on_and_otherwise_left_to_the_file(tmp_path, pretend):
    factors = pretend(scenario(Made()))
    assert start(tmp_path) == 0
    assert start(tmp_path, "10", "--real-time-factor", "0") == 0
    assert factors == [None, 0.0]
    assert start(tmp_path, "10", "--real-time-factor", "-1") == 2
    assert start(tmp_path, "10", "--real-time-factor", "nan") == 2


@pytest.mark.parametrize("duration", ["0", "-1", "nan", "soon"])
def test_an_impossible_duration_ends_with_status_2(tmp_path, duration):
    assert start(tmp_path, duration) == 2
    assert not (tmp_path / "demo").exists()
