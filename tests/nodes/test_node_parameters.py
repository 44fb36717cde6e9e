"""Which of the values in files and on the command line reach a node."""

import contextlib
import math
import tempfile
from pathlib import Path

import pytest
import rclpy
from hypothesis import given
from hypothesis import strategies as st
from rclpy.context import Context

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.node_tables import USE_SIM_TIME
from haptic_teleop_control.nodes.base.haptic_node import HapticNode
from haptic_teleop_control.nodes.base.parameters import overrides
from haptic_teleop_control.nodes.base.ros_arguments import parse_ros_arguments
from haptic_teleop_control.nodes.base.run import read_arguments
from haptic_teleop_control.parameters import Parameter, ParameterTable

TABLE = ParameterTable(
    "plant",
    [
        USE_SIM_TIME,
        Parameter("gain", 1.0, infinite=True),
        Parameter("part.count", 1),
        Parameter("model", ""),
        Parameter("label", ""),
        Parameter("enabled", False),
        Parameter("knots", [0.0]),
        Parameter("names", ["a"]),
        Parameter("board.type", "q8"),
    ],
)
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


@pytest.mark.parametrize("name", ["plant", "/**"])
def test_a_group_s_type_in_short_arrives_by_its_full_name_and_the_command_line_has_the_last_word(
    tmp_path, name
):
    text = section(name, "{board: remote}")
    assert read(tmp_path, text) == {"board.type": "remote"}
    assert read(tmp_path, text, "-p", "board.type:=q8_usb") == {"board.type": "q8_usb"}
    assert read(tmp_path, section(name, "{board: {type: q8}}"), "-p", "board:=remote") == {
        "board.type": "remote"
    }
    parsed = parse_ros_arguments(["--ros-args", "-p", "board:=remote"])
    assert overrides(OTHER, "/other/other", parsed, neighbours=[TABLE]) == []


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


def test_ros_own_parameters_reach_the_node(tmp_path):
    values = {"use_sim_time": True, "gain": 2.0}
    assert read(tmp_path, section("plant", "{use_sim_time: true, gain: 2}")) == values
    assert read(tmp_path, "", "-p", "use_sim_time:=true", "-p", "gain:=2") == values
    with pytest.raises(ConfigurationError, match="use_sim_time is 1; write true or false"):
        read(tmp_path, "", "-p", "use_sim_time:=1")


@pytest.mark.parametrize("target", ["plant", "/robot/plant"])
def test_a_value_for_a_named_node_reaches_it_by_name_and_full_name(tmp_path, target):
    assert read(tmp_path, "", "-p", f"{target}:gain:=3") == {"gain": 3.0}
    assert read(tmp_path, "", "-p", f"{target}:gain:=3", name="/robot/other") == {}


def test_a_wildcard_may_speak_to_a_neighbour_in_the_same_process(tmp_path):
    assert read(tmp_path, section("/**", "{colour: blue}"), neighbours=[OTHER]) == {}


def test_a_wildcard_may_speak_to_any_node_of_the_project_but_not_to_none(tmp_path):
    assert read(tmp_path, section("/**", "{command_source: device, gain: 2.0}")) == {"gain": 2.0}
    with pytest.raises(ConfigurationError, match="colour"):
        read(tmp_path, section("/**", "{colour: blue}"))


def test_a_renamed_node_reads_the_section_of_its_new_name():
    arguments = parse_ros_arguments(["--ros-args", "-r", "__node:=left", "-r", "__ns:=/arms"])
    assert arguments.full_name("plant", "robot") == "/arms/left"


# One YAML, whichever way a value comes.

SCALARS = st.one_of(
    st.floats().map(repr),
    st.integers().map(str),
    st.from_regex(r"[-+]?[0-9]{0,3}[._:]?[0-9]{0,3}([eE][-+]?[0-9]{1,2})?", fullmatch=True),
    st.sampled_from(["yes", "no", "On", "y", "~", "null", ".inf", "inf", "'1'", '"a b"', "a:b", "!!str 1"]),
    st.text(st.characters(codec="ascii", exclude_characters="\n\r"), max_size=6),
)
VALUES = SCALARS | st.lists(SCALARS, max_size=3).map(lambda entries: f"[{', '.join(entries)}]")


@given(st.sampled_from(["gain", "part.count", "label", "enabled", "knots", "names"]), VALUES)
def test_a_value_means_the_same_in_a_file_and_on_the_command_line(key, value):
    found = []
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "file.yaml")
        file.write_text(f"plant:\n  ros__parameters:\n    {key}: {value}\n")
        for arguments in (["--params-file", str(file)], ["-p", f"{key}:={value}"]):
            found.append("refused")
            with contextlib.suppress(ConfigurationError):
                parsed = parse_ros_arguments(["--ros-args", *arguments])
                (entry,) = overrides(TABLE, "/robot/plant", parsed)
                found[-1] = repr(entry.value)
    assert found[0] == found[1]


class Plant(HapticNode):
    NAME, NAMESPACE, SUMMARY, TABLE = "plant", "robot", "", TABLE


def value_in_a_node(key, *arguments):
    """What a real node holds that is started with these arguments, as itself and as others see it."""
    for_rcl, parsed, _ = read_arguments(["--ros-args", *arguments])
    context = Context()
    rclpy.init(args=for_rcl, context=context)
    try:
        node = Plant(context=context, parameter_overrides=overrides(TABLE, "/robot/plant", parsed))
        seen = node.get_parameter(key).value
        own = node.values.get(key, seen)
        node.destroy_node()
        assert own == (seen if isinstance(seen, (bool, int, float, str)) else list(seen))
        return own
    finally:
        context.try_shutdown()


@pytest.mark.parametrize(
    ("key", "text", "value"),
    [
        ("gain", "2e-2", 0.02),
        ("gain", "1e3", 1000.0),
        ("gain", ".5", 0.5),
        ("gain", "-.5", -0.5),
        ("gain", "3", 3.0),
        ("gain", ".inf", math.inf),
        ("part.count", "0x10", 16),
        ("enabled", "yes", True),
        ("enabled", "off", False),
        ("knots", "[1, 2.5, 1e-3]", [1.0, 2.5, 1e-3]),
        ("names", "[a, 'yes', b:c]", ["a", "yes", "b:c"]),
        ("label", "module:Law", "module:Law"),
        ("label", "12:30", "12:30"),
        ("label", "1_000", "1_000"),
        ("label", "y", "y"),
        ("label", "'1e3'", "1e3"),
        ("label", "a # b", "a"),
        ("use_sim_time", "true", True),
    ],
)
@pytest.mark.usefixtures("ros_isolation")
def test_a_started_node_has_the_value_from_file_and_command_line_alike(tmp_path, key, text, value):
    file = tmp_path / "file.yaml"
    file.write_text(f"plant:\n  ros__parameters:\n    {key}: {text}\n")
    for arguments in (("--params-file", str(file)), ("-p", f"{key}:={text}")):
        found = value_in_a_node(key, *arguments)
        assert (found, type(found)) == (value, type(value))


@pytest.mark.parametrize("key", ["gain", "part.count", "enabled", "knots"])
@pytest.mark.parametrize("text", ["1_000", "1:30", "0b1", "", "[[1.0]]", "{a: 1}", "a: b", "[1,", "*a", "@x"])
def test_what_is_no_such_value_is_refused_either_way(tmp_path, key, text):
    with pytest.raises(ConfigurationError, match=r"[.?]$"):
        read(tmp_path, f"plant:\n  ros__parameters:\n    {key}: {text}\n")
    with pytest.raises(ConfigurationError, match=r"--ros-args.*[.?]$"):
        read(tmp_path, "", "-p", f"{key}:={text}")


def test_rcl_gets_the_arguments_without_the_parameters():
    argv = ["--ros-args", "-p", "gain:=2", "-r", "__node:=x", "--params-file", "f", "--log-level", "warn"]
    found = parse_ros_arguments(argv)
    assert found.for_rcl == ["--ros-args", "-r", "__node:=x", "--log-level", "warn"]
    assert found.parameters == [(None, "gain", 2)]
    assert found.parameter_files == ["f"]
