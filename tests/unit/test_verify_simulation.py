"""A recording and the simulation of its own scenario: laid over each other, they tell what was changed."""

from __future__ import annotations

import copy
import json
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from identification_plants import STAGE

from haptic_teleop_control.errors import ConfigurationError, MismatchError
from haptic_teleop_control.recording import Recording, read_recording, write_recording
from haptic_teleop_sim import lockstep
from haptic_teleop_sim.lockstep import load_scenario, run_scenario
from haptic_teleop_sim.scenario_parameters import check_scenario
from haptic_teleop_sysid.commands import demo, verify
from haptic_teleop_sysid.runs.augmented_scenario import write_scenario
from haptic_teleop_sysid.verification.overlay import overlay
from haptic_teleop_sysid.verification.overlay_report import overlay_all, overlay_pictures, overlay_table
from haptic_teleop_sysid.verification.simulation import UntrustedCode, simulate_recording

SECONDS = 3.0
CONFIG = Path(__file__).resolve().parents[2] / "config"


def sections(delay=0.5, wall=0.3):
    stages = {f"stage{i}.{key}": value for i, level in ((1, 0.06), (2, 0.08)) for key, value in {
        "enabled": True, "delay": delay, "step.enabled": True, "step.amplitude": level}.items()}  # fmt: skip
    walls = {f"stage{i}.wall.{k}": v for i in (1, 2) for k, v in (("angle", wall), ("dissipation", 1.0))}
    return {"sfj_sim": walls, "omni_sim": {}, "force_controller": {}, "signal_generator": stages}


def recorded(said=None, **made):
    """A recording of the scenario `made`, which says of itself that it was `said`."""
    topics = run_scenario(check_scenario(sections(**made)), SECONDS)
    parameters = check_scenario(sections(**(made if said is None else said))).recorded
    return Recording(Path("bag"), topics, copy.deepcopy(dict(parameters)), experiment={"kind": "test"})


def fits(recording, remove_delay=False, scenario=None):
    result = overlay(recording, simulate_recording(recording, "bag", scenario), remove_delay)
    return result, result.as_json()["fit_percent"]


def test_a_recording_of_the_simulation_itself_fits_to_the_last_bit():
    result, fit = fits(recorded())
    assert result.delay == 0.0
    for stage in ("stage 1", "stage 2"):
        assert set(fit[stage].values()) == {100.0}, fit
    assert fit["omni z"]["position"] is None  # nobody moves it
    assert result.command == "the signal generator's parameters"


def test_a_recording_of_simulated_time_is_simulated_though_nodes_that_took_no_part_state_nothing():
    recording = recorded()
    for node, values in recording.parameters.items():
        values["use_sim_time"] = True
        assert node != "/link"
    _, fit = fits(recording)
    assert set(fit["stage 1"].values()) == {100.0}


def test_a_delayed_recording_fits_only_when_the_delay_is_removed():
    recording = recorded(said={"delay": 0.5}, delay=0.7)
    left, fit = fits(recording)
    assert left.delay == pytest.approx(0.2, abs=2e-3)
    assert fit["stage 1"]["arm position"] < 85.0
    removed, fit = fits(recording, remove_delay=True)
    assert removed.removed and removed.delay == left.delay
    assert fit["stage 1"]["arm position"] > 99.5
    assert fit["stage 2"]["environment torque"] > 98.0


def test_the_fit_is_one_hundred_times_one_minus_the_relative_error():
    recording = recorded(said={"wall": 0.4})
    result, fit = fits(recording)
    simulated = run_scenario(check_scenario(sections(wall=0.4)), SECONDS)["/sfj/joint_states"]
    y = recording.topics["/sfj/joint_states"].signal("stage1_arm", "position")
    error = np.linalg.norm(y - simulated.signal("stage1_arm", "position"))
    expected = 100.0 * (1.0 - error / np.linalg.norm(y - y.mean()))
    assert fit["stage 1"]["arm position"] == pytest.approx(expected, abs=1e-9)
    assert fit["stage 1"]["arm position"] < 80.0
    assert {"stage 1", "stage 2"} <= set(overlay_pictures(result)) < {one.group for one in result.comparisons}


def test_a_signal_that_is_constant_but_for_its_first_samples_has_no_fit_and_one_that_moves_briefly_has():
    recording = recorded()
    omni = recording.topics["/omni/joint_states"]
    effort = np.full(omni.effort.shape, 0.08)  # a constant torque against the device's weight, ...
    effort[:5] = 0.0  # ... once it is driven
    n = len(effort)
    brief = (np.arange(n) >= n // 2) & (np.arange(n) < n // 2 + n // 30)
    effort[brief, 2] += 0.05
    recording.topics["/omni/joint_states"] = replace(omni, effort=effort)
    result, fit = fits(recording)
    assert fit["omni y"]["effort"] is None
    assert fit["omni z"]["effort"] is not None
    _, rows, caption = overlay_table({"bag": result})
    table = {row[0]: row[1] for row in rows}
    assert table["omni y, effort"] == "hardly varies" and "hardly" in caption
    float(table["omni z, effort"])
    pictures = overlay_pictures(result)
    notes = {group: {panel.title: panel.note for panel in pictures[group].panels} for group in pictures}
    assert notes["omni y"]["Effort"] == "hardly varies"
    assert notes["omni z"]["Effort"] == f"fit {fit['omni z']['effort']:.1f} %"


def test_a_command_that_no_generator_gave_is_taken_from_the_recording():
    recording = recorded()
    reference = recording.topics.pop("/reference")
    omni = recording.topics["/omni/joint_states"]
    # A hand that held the device where the reference wanted it.
    position = omni.position.copy()
    index = np.searchsorted(reference.stamp, omni.stamp, side="right") - 1
    position[:, 1:] = reference.position[np.maximum(index, 0)]
    recording.topics["/omni/joint_states"] = replace(omni, position=position)
    control = recording.parameters["/force_controller"]
    control["command_source"] = "device"
    del recording.parameters["/signal_generator"]
    result, fit = fits(recording)
    assert result.command == "what /omni/joint_states recorded"
    assert fit["stage 1"]["arm position"] > 99.0
    assert fit["stage 2"]["environment torque"] > 98.0


def test_robots_that_were_not_simulated_need_a_scenario_file_for_their_plants(tmp_path):
    recording = recorded()
    for plant, driver in (("sfj_sim", "sfj_driver"), ("omni_sim", "omni_driver")):
        robot = plant.split("_")[0]
        recording.parameters[f"/{robot}/{driver}"] = {"rate": 500.0}
        del recording.parameters[f"/{robot}/{plant}"]
    left_out = overlay_all({"bag": recording}, None, False)
    assert "sfj_sim and omni_sim" in left_out.reasons["bag"] and not left_out.done
    with pytest.raises(MismatchError, match=r"bag was not made with sfj_sim.*--simulate"):
        simulate_recording(recording, "bag")
    file = tmp_path / "plants.yaml"
    file.write_text(
        "sfj_sim: {ros__parameters: {stage1.wall: {angle: 0.3, dissipation: 1.0}, "
        "stage2.wall: {angle: 0.3, dissipation: 1.0}}}\n"
    )
    result, fit = fits(recording, scenario=str(file))
    assert result.plants == str(file)
    assert fit["stage 1"]["arm position"] == 100.0


def test_a_model_file_that_is_not_here_leaves_a_run_out_unless_its_simulation_was_asked_for():
    recording = recorded()
    recording.parameters["/sfj/sfj_sim"]["stage1.model"] = "not/here.yaml"
    reasons = overlay_all({"bag": recording}, None, False).reasons
    assert "cannot be simulated here" in reasons["bag"] and "not/here.yaml" in reasons["bag"]
    with pytest.raises(ConfigurationError, match=r"bag cannot be simulated.*not/here\.yaml"):
        simulate_recording(recording, "bag")


@pytest.mark.usefixtures("unillustrated")
def test_a_recording_holds_the_models_that_it_was_made_with(tmp_path, monkeypatch, capsys):
    made, elsewhere = tmp_path / "made", tmp_path / "elsewhere"
    made.mkdir(), elsewhere.mkdir()
    slower = STAGE.with_values({"motor_damping": 2.0 * STAGE.parameters["motor_damping"]})
    slower.save(made / "augmented_model.yaml")
    write_scenario(made, slower, "augmented_model.yaml")
    monkeypatch.chdir(made)
    assert lockstep.main(["scenario.yaml", "--duration", "5", "--record", "simulated"]) == 0
    bag = str(made / "simulated")
    stated = read_recording(bag).parameters["/sfj/sfj_sim"]["stage1.model"]
    assert stated == str(made / "augmented_model.yaml"), "as the nodes state it"
    (made / "augmented_model.yaml").unlink()
    monkeypatch.chdir(elsewhere)
    verify.main([bag, "--output", "out"])
    result = json.loads((elsewhere / "out" / "verify.json").read_text())
    assert set(result["simulation"][bag]["fit_percent"]["stage 1"].values()) == {100.0}


@pytest.mark.usefixtures("unillustrated")
def test_without_a_simulation_the_run_is_no_more_than_a_note_and_why_is_said_once(tmp_path, capsys):
    one = recorded()
    one.parameters["/sfj/sfj_sim"]["stage1.model"] = "not/here.yaml"
    bag = str(write_recording(tmp_path / "simulated", one.topics, one.parameters, {}))
    assert verify.main([bag, "--output", str(tmp_path / "out")]) == 0
    result = json.loads((tmp_path / "out" / "verify.json").read_text())
    assert result["conclusion"]["status"] == "fair"
    page = (tmp_path / "out" / "report.html").read_text()
    for told in (result["not_simulated"][bag], capsys.readouterr().out, page):
        assert told.count("cannot be simulated") == 1 and told.count("not/here.yaml") <= 2


@pytest.mark.long
def test_the_second_scenario_is_laid_over_its_simulation_too(tmp_path, capsys):
    scenario = load_scenario(CONFIG / "scenario2_sim.yaml")
    topics = run_scenario(scenario, 7.0)
    bag = str(write_recording(tmp_path / "second", topics, dict(scenario.recorded), {"kind": "second"}))
    assert verify.main([bag, "--output", str(tmp_path / "out")]) == 0
    result = json.loads((tmp_path / "out" / "verify.json").read_text())
    assert result["scenario"] == 2
    assert result["simulation"][bag]["fit_percent"]["omni y"]["position"] == 100.0
    assert (tmp_path / "out" / "simulation_omniy.png").stat().st_size > 10_000
    axes = result["runs"][bag]["stages"]
    for axis, speed in (("omni_y", 0.499), ("omni_z", 0.498)):  # of 0.5 asked
        free, contact = axes[axis]["free"][0], axes[axis]["contacts"][0]
        assert free["speed"] == pytest.approx(speed, abs=2e-3) and free["expected_speed"] == pytest.approx(
            0.5
        )
        assert contact["settled_torque"] == pytest.approx(0.1, abs=2e-3) and contact["bounces"] == 0
        assert (tmp_path / "out" / f"{axis}.png").stat().st_size > 10_000
    said = capsys.readouterr().out
    assert "Omni Y in contact" in said and "an estimated 0.1" in said and "limit 0.446 N·m" in said
    page = (tmp_path / "out" / "report.html").read_text()
    assert "Scenario 2" in page and "> commanded torque<" in page
    assert "commanded current" not in page, "the Omni's motors are told by their torque"
    first = str(write_recording(tmp_path / "first", recorded().topics, recorded().parameters, {}))
    assert verify.main([first, bag, "--output", str(tmp_path / "both")]) == 2
    assert "not all of one scenario" in capsys.readouterr().err


@pytest.mark.usefixtures("unillustrated")
def test_of_two_recordings_of_the_second_scenario_the_agreement_is_told(tmp_path):
    scenario = load_scenario(CONFIG / "scenario2_sim.yaml")
    bags = [str(tmp_path / name) for name in ("one", "two")]
    for bag, seed in zip(bags, (1, 2), strict=True):
        topics = run_scenario(scenario, 7.0, seed)
        if bag == bags[1]:
            del topics["/reference"]  # what was asked for is unknown then
        write_recording(bag, topics, dict(scenario.recorded), {})
    three = str(
        write_recording(tmp_path / "three", run_scenario(scenario, 7.0, 3), dict(scenario.recorded), {})
    )
    output = tmp_path / "out"
    assert verify.main([bags[0], three, "--output", str(output), "--no-simulation", "--lambda", "0.4"]) == 0
    result = json.loads((output / "verify.json").read_text())
    assert result["agreement"][three]["omni_y"]["arm_position"] > 90.0
    assert result["runs"][three]["stages"]["omni_z"]["free"][0]["expected_speed"] == pytest.approx(0.25)
    assert verify.main([bags[1], "--output", str(tmp_path / "without"), "--no-simulation"]) == 0
    assert not json.loads((tmp_path / "without" / "verify.json").read_text())["runs"][bags[1]]["stages"]


@pytest.mark.long
def test_the_report_shows_the_recording_over_its_simulation_unless_told_not_to(tmp_path):
    one = recorded()
    bag = str(write_recording(tmp_path / "bag", one.topics, one.parameters, {}))
    output, without = tmp_path / "out", tmp_path / "without"
    assert verify.main([bag, "--output", str(output)]) == 0
    assert verify.main([bag, "--output", str(without), "--no-simulation"]) == 0
    pages = [(folder / "report.html").read_text() for folder in (output, without)]
    drawn = [path.name for path in output.iterdir() if path.name.startswith("simulation_")]
    assert {"simulation_stage1.png", "simulation_stage2.png"} <= set(drawn)
    assert pages[0].count("<svg role=") == pages[1].count("<svg role=") + len(drawn)
    title = "Simulation and recording of the same scenario"
    assert title in pages[0] and title not in pages[1]
    assert json.loads((without / "verify.json").read_text())["simulation"] == {}


@pytest.mark.parametrize("arguments", [["--simulate", "absent.yaml"], ["--simulate", "x", "--no-simulation"]])
def test_a_scenario_file_that_cannot_be_used_ends_with_status_2(tmp_path, arguments):
    one = recorded()
    bag = str(write_recording(tmp_path / "bag", one.topics, one.parameters, {}))
    assert verify.main([bag, "--output", str(tmp_path / "out"), *arguments]) == 2


FOREIGN = """
from pathlib import Path
Path("executed").touch()
from haptic_teleop_control.laws import AugmentedErrorLaw
class Law(AugmentedErrorLaw): ...
"""


@pytest.fixture
def foreign(tmp_path, monkeypatch):
    """A folder to work in that holds the module which a recording names; it leaves a file when executed."""
    (tmp_path / "somebodys_law.py").write_text(FOREIGN)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.path", [*sys.path])
    monkeypatch.delitem(sys.modules, "somebodys_law", raising=False)
    return tmp_path


def names_law(law, nested=False):
    one = recorded()
    values = one.parameters["/force_controller"]
    values["law"] = {"ros__parameters": law} if nested else law
    return one


@pytest.mark.usefixtures("unillustrated")
@pytest.mark.parametrize("nested", [False, True])
def test_code_that_a_recording_names_is_executed_only_when_it_is_said_to_be_trusted(foreign, capsys, nested):
    one = names_law("somebodys_law:Law", nested)
    plain = recorded()
    bags = [
        str(write_recording(foreign / name, r.topics, r.parameters, {}))
        for name, r in (("bag", one), ("plain", plain))
    ]
    assert verify.main([*bags, "--output", "out"]) == 0
    assert not (foreign / "executed").exists() and "somebodys_law" not in sys.modules
    result = json.loads((foreign / "out" / "verify.json").read_text())
    page = re.sub("<[^>]+>", "", Path("out/report.html").read_text())  # as it is read
    for told in (result["not_simulated"][bags[0]], capsys.readouterr().out, page):
        assert "somebodys_law:Law" in told and "--trust-recorded-code" in told
    assert set(result["simulation"]) == {bags[1]}, "the others are simulated"
    assert result["runs"][bags[0]]["stages"]["stage1"]["contacts"], "the rest of verify goes on"
    assert verify.main([*bags, "--output", "trusted", "--trust-recorded-code"]) == 0
    assert (foreign / "executed").exists()
    result = json.loads((foreign / "trusted" / "verify.json").read_text())
    assert result["simulation"][bags[0]]["fit_percent"]["stage 1"]["arm position"] == 100.0


def test_a_scenario_file_for_the_plants_does_not_make_the_recordings_code_trusted(foreign):
    with pytest.raises(UntrustedCode, match=r"bag names 'somebodys_law:Law'.*--trust-recorded-code"):
        simulate_recording(names_law("somebodys_law:Law"), "bag", str(CONFIG / "scenario1_sim.yaml"))
    assert not (foreign / "executed").exists()


@pytest.mark.parametrize(
    "law", ["augmented_error", "haptic_teleop_control.laws.augmented_error:AugmentedErrorLaw"]
)
def test_a_law_of_the_project_needs_no_trust_however_it_is_named(law):
    _, fit = fits(names_law(law))
    assert fit["stage 1"]["arm position"] == 100.0


@pytest.mark.parametrize("law", ["haptic_teleop_control.plugins:load_object", "os:system", "haptic_law:L"])
def test_what_only_looks_like_the_projects_is_not_trusted(law):
    with pytest.raises(UntrustedCode):
        simulate_recording(names_law(law), "bag")


def test_processes_are_started_without_the_modules_of_the_working_directory(tmp_path, monkeypatch):
    (tmp_path / "yaml.py").write_text("open('executed', 'w')\nraise SystemExit(3)\n")
    monkeypatch.chdir(tmp_path)
    assert demo.run_scenario(Path("absent.yaml"), tmp_path / "recording", 1.0) == 2
    assert not (tmp_path / "executed").exists()
