"""YAML that somebody mistyped: file, line and column are named, whatever file it is."""

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from haptic_teleop_control.errors import HapticTeleopError
from haptic_teleop_control.parameter_files import load_parameter_file
from haptic_teleop_control.strict_yaml import dump_yaml, parse_value, parse_yaml, yaml_problem
from haptic_teleop_omni.layout import load_layout
from haptic_teleop_sim.model import load_model
from haptic_teleop_sysid.commands.hand_table import read_table

READERS = [load_parameter_file, load_model, load_layout, read_table]
BROKEN = "first: 1\nsecond: [1, 2\nthird: 3\n"
TWICE = "first: {}\nfirst: {}\n"


@pytest.mark.parametrize("read", READERS)
@pytest.mark.parametrize(("text", "place"), [(BROKEN, "line 3, column 6: "), (TWICE, "line 2, column 1: ")])
def test_a_broken_file_is_named_with_line_and_column(tmp_path, read, text, place):
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    with pytest.raises(HapticTeleopError) as refusal:
        read(*((str(path), ("first",)) if read is read_table else (str(path),)))
    assert str(refusal.value).startswith(f"{path}: {place}")
    assert "unicode string" not in str(refusal.value)


def test_numbers_are_what_ros_takes_them_for():
    numbers = [1e-3, 150.0, -2e4, 0.5, 16]
    assert parse_yaml("[1e-3, 1.5E+2, -2e4, .5, 0x10]") == numbers
    assert parse_yaml("[1e3x, e3, yes]") == ["1e3x", "e3", True]


def test_nothing_but_plain_data_is_made_of_a_file():
    with pytest.raises(yaml.YAMLError):
        parse_yaml("!!python/object/apply:os.getcwd []")


@pytest.mark.parametrize("text", ["12:30", "1_000", "0b1", "0x_", "08", "2026-01-31", "1e3x", "=", "a:b"])
def test_what_only_looks_like_a_number_or_a_date_is_text(text):
    assert parse_yaml(text) == text


@pytest.mark.parametrize("text", ["!!int much", "!!float x", "!!timestamp soon", "9" * 5000, "[" * 5000])
def test_a_scalar_that_is_not_what_its_tag_says_is_refused_as_yaml(text):
    with pytest.raises(yaml.YAMLError) as refusal:
        parse_yaml(f"key: {text}")
    assert yaml_problem(refusal.value).endswith("; correct that line.")


def test_a_mapping_may_take_over_what_another_one_states():
    assert parse_yaml("a: &a {x: 1, y: 2}\nb: {<<: *a, y: 3}")["b"] == {"x": 1, "y": 3}


PLAIN = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False)
TEXTS = st.text(max_size=12) | st.from_regex(r"[-+]?[0-9_.:xbe~<=]{1,8}", fullmatch=True)


@given(st.dictionaries(TEXTS, PLAIN | TEXTS | st.lists(PLAIN | TEXTS, max_size=3), max_size=4))
def test_what_is_written_is_read_back_in_either_dialect(content):
    assert parse_yaml(dump_yaml(content)) == content
    assert yaml.safe_load(dump_yaml(content)) == content


def test_a_value_is_read_as_behind_a_key():
    assert parse_value("[1, 2e-2, a:b]") == [1, 0.02, "a:b"]
    assert parse_value("") is None
    for text in ("a: b", "- 1", "1\nother: 2", "1\nvalue: 2", "[1,", "*a", "@x"):
        with pytest.raises(yaml.YAMLError):
            parse_value(text)
