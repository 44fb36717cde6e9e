"""YAML that somebody mistyped: file, line and column are named, whatever file it is."""

import pytest
import yaml

from haptic_teleop_control.errors import HapticTeleopError
from haptic_teleop_control.parameter_files import load_parameter_file
from haptic_teleop_control.strict_yaml import parse_yaml
from haptic_teleop_omni.layout import load_layout
from haptic_teleop_sim.model import load_model
from haptic_teleop_sysid.hand_table import read_table

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
