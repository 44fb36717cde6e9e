"""docs/bring_your_own_robot.md, done literally: its commands find what the generator hid in its logs."""

import importlib.util
import json
import math
import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from pages import DOCS, blocks, run

from haptic_teleop_control.recording import read_recording
from haptic_teleop_sim.model import load_model
from haptic_teleop_sysid.recordings.dataset import load_dataset

PAGE = (DOCS / "bring_your_own_robot.md").read_text(encoding="utf-8")
pytestmark = [pytest.mark.no_graph, pytest.mark.long]


@pytest.fixture(scope="module")
def generator(tmp_path_factory):
    """(label of the case, folder with its logs as the generator makes them now)."""
    spec = importlib.util.spec_from_file_location("make", DOCS / "examples" / "make.py")
    make = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(make)
    case, folder = make.drawn(), tmp_path_factory.mktemp("drawn")
    make.write(case, folder)
    return case.label, folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The folder after the page's commands and files, in its order."""
    folder = tmp_path_factory.mktemp("somewhere")
    shutil.copytree(DOCS / "examples", folder / "docs" / "examples")
    for language, file, text in blocks("bring_your_own_robot.md"):
        if file:
            (folder / file).write_text(text, encoding="utf-8")
        elif language == "bash":
            assert len(text.splitlines()) == 3
            run(text, folder)
    return folder


def test_the_shipped_logs_are_those_of_the_generator(generator):
    for name in ("learn.csv", "check.csv"):
        shipped, drawn = (
            np.loadtxt(f / name, delimiter=",", skiprows=1) for f in (DOCS / "examples", generator[1])
        )
        # Another processor may round the last digit, or the step of an encoder, the other way.
        assert shipped.shape == drawn.shape and np.allclose(shipped, drawn, atol=0.03)
        assert np.mean(np.abs(shipped - drawn) < 2e-4) > 0.99


def test_the_shipped_recordings_are_of_the_same_robot(generator):
    places = (DOCS / "examples" / "stage2", generator[1] / "stage2")
    for name in ("learn", "check"):
        shipped, drawn = (read_recording(place / name).topics["/sfj/joint_states"] for place in places)
        assert np.array_equal(shipped.stamp, drawn.stamp)
        assert np.mean(np.abs(shipped.position - drawn.position) < 1e-6) > 0.99
    assert (places[0] / "model.yaml").read_text() == (places[1] / "model.yaml").read_text()


def test_its_three_commands_name_what_is_hidden_and_its_size(folder, generator):
    (hidden,) = generator[0]["truth"]
    found = json.loads((folder / "j2_diagnosis" / "diagnosis.json").read_text())
    assert found["verdict"] == "identified" and len(found["findings"]) == 1
    named = found["findings"][0]
    assert (named["effect"], named["location"]) == (hidden["effect"], "j2_joint")
    width = named["parameters"]["width"]
    truth = hidden["parameters"]["width"]
    assert width["value"] == pytest.approx(truth, rel=0.05)
    assert abs(width["value"] - truth) < 2.5 * width["std"]
    assert found["runtime_s"] < 300.0
    augmented = load_model(folder / "j2_diagnosis" / "augmented_model.yaml").parameters
    for name, value in generator[0]["truth_parameters"].items():
        if name != "torque_constant":  # the log holds the torque
            assert augmented[name] == pytest.approx(value, rel=0.08), name


def test_the_page_states_what_is_found_and_what_was_hidden(folder, generator):
    width = json.loads((folder / "j2_diagnosis" / "diagnosis.json").read_text())["findings"][0]["parameters"][
        "width"
    ]
    text = PAGE.split("backlash at j2_joint (")[1]
    stated, std = text.split("width ")[1].split(" rad")[0].split(" ± ")
    assert width["value"] == pytest.approx(float(stated), abs=0.3 * float(std))
    hidden = generator[0]["truth"][0]["parameters"]["width"]
    assert float(text.split("rad`. ")[1].split(" rad was hidden")[0]) == pytest.approx(hidden, rel=1e-3)
    assert math.degrees(hidden) == pytest.approx(1 / 6, rel=0.05)
    assert f"{generator[0]['truth_parameters']['stiffness']:.2f} is true" in PAGE


def test_the_page_states_the_parameters_that_are_found(folder):
    found = load_model(folder / "j2_diagnosis" / "augmented_model.yaml").parameters
    stated = load_model(folder / "my_joint.yaml").parameters
    assert stated == pytest.approx(found, rel=0.02)
    words = " ".join(PAGE.split())
    assert f"the stiffness comes out as {stated['stiffness']:.2f} N·m/rad" in words
    start = load_model(folder / "j2.yaml").parameters
    assert float(words.split("yet the stiffness, ")[1].split(" ")[0]) == pytest.approx(
        start["stiffness"], rel=0.01
    )


def test_the_page_states_the_fits_of_the_three_models(folder):
    fit = json.loads((folder / "j2_diagnosis" / "diagnosis.json").read_text())["fit"]
    text = (
        " ".join(PAGE.split()).split("](index.md#model-and-diagnosis) of ")[1].split(" with the backlash")[0]
    )
    stated = [int(n) for n in re.findall(r"(\d+) %", text)]
    found = [fit[model]["validation"]["j2_arm.velocity"] for model in ("given", "baseline", "augmented")]
    assert stated == pytest.approx(found, abs=1.0)


def test_the_model_file_of_the_page_reads_the_recordings_of_the_page(folder):
    model = load_model(folder / "my_joint.yaml")
    written = load_model(folder / "j2.yaml")
    assert (model.robot, model.joint, model.structure, model.fixed) == (
        written.robot, written.joint, written.structure, written.fixed,
    )  # fmt: skip
    assert model.io == written.io
    data = load_dataset(read_recording(folder / "j2" / "learn"), model)
    assert data.arm_position is not None and data.input_unit == "N*m" and len(data) == 4500
