"""Which of the values in files and on the command line reach a node."""

import pytest

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.nodes.base.parameters import overrides
from haptic_teleop_control.nodes.base.ros_arguments import parse_ros_arguments
from haptic_teleop_control.parameters import Parameter, ParameterTable

TABLE = ParameterTable("plant", [Parameter("gain", 1.0), Parameter("part.count", 1), Parameter("model", "")])
OTHER = ParameterTable("other", [Parameter("gain", 2.0), Parameter("colour", "red")])


def read(tmp_path, text="", *arguments, name="/robot/plant", neighbours=()):
    files = []
    if text:
        (tmp_path / "file.yaml").write_text(text)
        files = ["--params-file", str(tmp_path / "file.yaml")]
    parsed = parse_ros_arguments(["--ros-args", *files, *arguments])
    return {entry.name: entry.value for entry in overrides(TABLE, name, parsed, neighbours)}


def section(name, values):
    return f"{name}:\n  ros__parameters: {values}\n"


@pytest.mark.parametrize("name", ["plant", "/robot/plant", "robot/plant", "/**", "/*/plant", "/**/plant"])
def test_a_section_reaches_the_node_by_name_full_name_or_wildcard(tmp_path, name):
    assert read(tmp_path, section(name, "{gain: 3.0}")) == {"gain": 3.0}


@pytest.mark.parametrize("name", ["other", "/plant", "/other/plant", "/*"])
def test_a_section_of_another_node_does_not(tmp_path, name):
    assert read(tmp_path, section(name, "{gain: 3.0, unknown: 1}")) == {}


def test_the_more_particular_section_wins_and_the_command_line_over_all(tmp_path):
    text = (
        section("/robot/plant", "{gain: 4.0}")
        + section("plant", "{gain: 3.0}")
        + section("/**", "{gain: 2.0}")
    )
    assert read(tmp_path, text) == {"gain": 4.0}
    assert read(tmp_path, text, "-p", "gain:=5.0") == {"gain": 5.0}
    assert read(tmp_path, text, "-p", "plant:gain:=6.0", "-p", "other:gain:=7.0") == {"gain": 6.0}


def test_a_whole_number_is_taken_where_a_number_is_wanted(tmp_path):
    value = read(tmp_path, section("plant", "{gain: 3}"))["gain"]
    assert (value, type(value)) == (3.0, float)


def test_nested_and_dotted_keys_are_the_same(tmp_path):
    assert read(tmp_path, section("plant", "{part: {count: 3}}")) == {"part.count": 3}
    assert read(tmp_path, section("plant", "{part.count: 3}")) == {"part.count": 3}


def test_a_model_is_looked_for_beside_the_file_that_names_it(tmp_path):
    found = read(tmp_path, section("plant", "{model: models/a.yaml}"))
    assert found == {"model": str(tmp_path / "models" / "a.yaml")}
    assert read(tmp_path, "", "-p", "model:=a.yaml") == {"model": "a.yaml"}


def test_ros_own_parameters_pass(tmp_path):
    assert read(tmp_path, section("plant", "{use_sim_time: false, gain: 2.0}")) == {"gain": 2.0}


def test_a_wildcard_may_speak_to_a_neighbour_in_the_same_process(tmp_path):
    assert read(tmp_path, section("/**", "{colour: blue}"), neighbours=[OTHER]) == {}


def test_a_wildcard_may_speak_to_any_node_of_the_project_but_not_to_none(tmp_path):
    assert read(tmp_path, section("/**", "{command_source: device, gain: 2.0}")) == {"gain": 2.0}
    with pytest.raises(ConfigurationError, match="colour"):
        read(tmp_path, section("/**", "{colour: blue}"))


def test_a_renamed_node_reads_the_section_of_its_new_name():
    arguments = parse_ros_arguments(["--ros-args", "-r", "__node:=left", "-r", "__ns:=/arms"])
    assert arguments.full_name("plant", "robot") == "/arms/left"
