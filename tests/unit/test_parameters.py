"""Parameter tables and files: what is accepted, and that each refusal names file, node, key and remedy."""

from __future__ import annotations

import math

import pytest

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.parameter_files import check_parameter_file, load_parameter_file, parameters_for
from haptic_teleop_control.parameters import Parameter, ParameterTable

TABLE = ParameterTable(
    "force_controller",
    [
        Parameter("rate", 500.0, "Hz", above=0.0, maximum=2000.0, meaning="loop rate"),
        Parameter("stage1.lambda", 0.5, "N·m·s/rad", above=0.0, runtime=True, meaning="velocity penalty"),
        Parameter("stage1.limit", math.inf, "A", above=0.0, infinite=True),
        Parameter("law", "augmented_error", choices=("augmented_error", "none")),
        Parameter("depth", 10, minimum=1, maximum=100),
        Parameter("offsets", [0.0, 0.0], "rad", length=2, minimum=-1.0, below=1.0),
        Parameter("enabled", False, runtime=True),
    ],
)


def refusal(mapping: dict, source: str = "robot.yaml") -> str:
    with pytest.raises(ConfigurationError) as caught:
        TABLE.check(mapping, source)
    return str(caught.value)


def write(path, text: str):
    path.write_text(text, encoding="utf-8")
    return path


def test_what_is_not_stated_keeps_its_default_and_whole_numbers_become_float():
    checked = TABLE.check({"rate": 1000, "offsets": [0, 0.5]})
    assert checked["rate"] == 1000.0 and isinstance(checked["rate"], float)
    assert checked["offsets"] == [0.0, 0.5] and isinstance(checked["offsets"][0], float)
    assert checked["stage1.lambda"] == 0.5
    assert set(checked) == {parameter.name for parameter in TABLE}


def test_changing_a_returned_list_does_not_change_the_default():
    TABLE.check({})["offsets"][0] = 9.0
    assert TABLE.check({})["offsets"] == [0.0, 0.0]


@pytest.mark.parametrize(
    ("mapping", "words"),
    [
        ({"stage1.lamda": 1.0}, ["stage1.lamda", "did you mean stage1.lambda?"]),
        ({"zzz": 1.0}, ["zzz", "known are rate"]),
        ({"stage1": 1.0}, ["stage1", "a group of them", "stage1.lambda"]),
        ({"rate": "fast"}, ["rate", "'fast'", "write a number"]),
        ({"rate": True}, ["rate", "True", "write a number"]),
        ({"rate": None}, ["rate", "None", "write a number"]),
        ({"rate": "inf"}, ["rate", ".inf"]),
        ({"rate": math.nan}, ["rate", "nan", "finite"]),
        ({"rate": math.inf}, ["rate", "inf", "finite"]),
        ({"stage1.limit": math.nan}, ["stage1.limit", "nan"]),
        ({"rate": 0.0}, ["rate", "0 < value <= 2000", "0 Hz"]),
        ({"rate": 2000.1}, ["rate", "0 < value <= 2000"]),
        ({"law": "augmented_eror"}, ["law", "did you mean augmented_error?", "augmented_error | none"]),
        ({"depth": 10.0}, ["depth", "10.0", "whole number"]),
        ({"depth": True}, ["depth", "True", "whole number"]),
        ({"offsets": [0.0]}, ["offsets", "1 elements", "exactly 2"]),
        ({"offsets": 0.0}, ["offsets", "write a list"]),
        ({"offsets": []}, ["offsets", "empty"]),
        ({"offsets": [0.0, 1.0]}, ["offsets", "element 1", "-1 <= value < 1"]),
        ({"enabled": "yes"}, ["enabled", "true or false"]),
    ],
)
def test_a_refusal_names_file_node_key_and_remedy(mapping, words):
    message = refusal(mapping)
    for word in ["robot.yaml", "force_controller", *words]:
        assert word in message
    assert not message.endswith("?.")


KIND = ParameterTable("driver", [Parameter("board.type", "q8"), Parameter("board.id", "0")])


def test_a_text_at_the_name_of_a_group_is_short_for_its_type_and_for_nothing_else(tmp_path):
    long = {"board.type": "remote", "board.id": "0"}
    assert KIND.check({"board": "remote"}) == KIND.check({"board.type": "remote"}) == long
    for section in ("driver", "/**"):
        file = write(tmp_path / "f.yaml", f"{section}:\n  ros__parameters: {{board: remote}}\n")
        assert check_parameter_file(file, {"driver": KIND, "other": TABLE})["driver"] == long
    for value in (3, None, True, ["remote"]):
        with pytest.raises(ConfigurationError, match=r"board is not .* it has board\.type, board\.id"):
            KIND.check({"board": value})
    with pytest.raises(ConfigurationError, match=r"stage1 is not .* a group of them"):
        TABLE.check({"stage1": "remote"})
    named = ParameterTable("n", [Parameter("board", "a"), Parameter("board.type", "b")])
    assert named.check({"board": "c"}) == {"board": "c", "board.type": "b"}


def test_a_type_that_is_stated_in_short_and_in_full_is_refused_even_where_both_say_the_same():
    words = r"f\.yaml: node driver: parameter board\.type is stated twice.*`board:`"
    with pytest.raises(ConfigurationError, match=words):
        KIND.check({"board": "remote", "board.type": "remote"}, "f.yaml")


def test_bounds_are_inclusive_for_minimum_and_maximum_and_exclusive_for_above_and_below():
    assert TABLE.check({"rate": 2000.0})["rate"] == 2000.0
    assert TABLE.check({"offsets": [-1.0, 0.999]})["offsets"] == [-1.0, 0.999]
    assert TABLE.check({"stage1.limit": math.inf})["stage1.limit"] == math.inf


def test_a_required_parameter_must_be_stated():
    table = ParameterTable("n", [Parameter("path", "a.yaml", required=True)])
    assert table.check({"path": "b.yaml"}) == {"path": "b.yaml"}
    with pytest.raises(ConfigurationError, match=r"f\.yaml: node n: parameter path is missing; add it"):
        table.check({}, "f.yaml")


def test_only_runtime_parameters_change_while_the_node_runs():
    current = TABLE.check({"rate": 250.0})
    assert TABLE.change(current, {"stage1.lambda": 0.7}) == {**current, "stage1.lambda": 0.7}
    assert TABLE.change(current, {"rate": 250.0}) == current
    with pytest.raises(ConfigurationError, match="rate cannot change while the node runs"):
        TABLE.change(current, {"rate": 100.0})
    with pytest.raises(ConfigurationError, match=r"stage1\.lambda is 0"):
        TABLE.change(current, {"stage1.lambda": 0.0})


def test_a_declaration_that_contradicts_itself_is_refused():
    with pytest.raises(ValueError, match="default"):
        Parameter("a", 2.0, maximum=1.0)
    with pytest.raises(ValueError, match="empty list"):
        Parameter("a", [])
    with pytest.raises(ValueError, match="NoneType"):
        Parameter("a", None)
    with pytest.raises(ValueError, match="twice"):
        ParameterTable("n", [Parameter("a", 1), Parameter("a", 2)])


def test_nested_and_dotted_keys_and_nested_namespaces_read_alike(tmp_path):
    flat = write(tmp_path / "flat.yaml", "/sfj/sim:\n  ros__parameters:\n    a.b.c: 1\n    a.d: [1.0, 2.0]\n")
    nested = write(
        tmp_path / "nested.yaml",
        "/sfj:\n  sim:\n    ros__parameters:\n      a:\n        b: {c: 1}\n        d: [1.0, 2.0]\n",
    )
    assert (
        load_parameter_file(flat)
        == load_parameter_file(nested)
        == {"/sfj/sim": {"a.b.c": 1, "a.d": [1.0, 2.0]}}
    )


def test_numbers_are_read_as_ros_reads_them(tmp_path):
    path = write(
        tmp_path / "n.yaml", "n:\n  ros__parameters: {a: 1e-3, b: .inf, c: 2, d: -1E+3, e: '1e-3'}\n"
    )
    assert load_parameter_file(path) == {"n": {"a": 0.001, "b": math.inf, "c": 2, "d": -1000.0, "e": "1e-3"}}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("n:\n  ros__parameters:\n    a: 1\n    a: 2\n", ["line 4", "a is stated twice"]),
        ("n:\n  ros__parameters:\n    a.b: 1\n    a: {b: 2}\n", ["n", "a.b is stated twice"]),
        ("n:\n  ros__parameters: {}\nn:\n  ros__parameters: {}\n", ["n is stated twice"]),
        ("/s/n:\n  ros__parameters: {}\n/s:\n  n:\n    ros__parameters: {}\n", ["/s/n is stated twice"]),
        ("n:\n  a: 1\n", ["n/a", "ros__parameters"]),
        ("n:\n  ros__parameters:\n    a: [1\n", ["line"]),
        ("n:\n  ros__parameters:\n", ["n", "empty"]),
        ("n:\n  ros__parameters: {a: 1}\n  b: 2\n", ["n", "b stands beside"]),
        ("", ["holds no node"]),
        ("- 1\n", ["holds no node"]),
        ("n:\n  ros__parameters: {a: !!python/object/apply:os.getcwd []}\n", ["line 2"]),
    ],
)
def test_a_file_that_is_not_in_the_layout_is_refused_with_its_name(tmp_path, text, words):
    path = write(tmp_path / "broken.yaml", text)
    with pytest.raises(ConfigurationError) as caught:
        load_parameter_file(path)
    for word in [str(path), *words]:
        assert word in str(caught.value)


def test_a_missing_or_binary_file_is_one_sentence(tmp_path):
    with pytest.raises(ConfigurationError, match="cannot be read"):
        load_parameter_file(tmp_path / "none.yaml")
    binary = tmp_path / "binary.yaml"
    binary.write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(ConfigurationError, match="cannot be read"):
        load_parameter_file(binary)


def test_the_section_of_a_node_wins_over_a_wildcard_wherever_it_stands():
    sections = {"/sfj/sim": {"a": 1}, "/**": {"a": 0, "b": 0}, "/omni/*": {"b": 5}, "/**/sim": {"c": 7}}
    assert parameters_for(sections, "/sfj/sim") == {"a": 1, "b": 0, "c": 7}
    assert parameters_for(sections, "/omni/sim") == {"a": 0, "b": 5, "c": 7}
    assert parameters_for(sections, "/omni/deep/other") == {"a": 0, "b": 0}
    assert parameters_for({"sim": {"a": 1}}, "/sim") == {"a": 1}
    assert parameters_for({"sim": {"a": 1}}, "/sfj/sim") == {}
    assert parameters_for({"/sfj/sim": {"a": 1}}, "sim") == {"a": 1}


def test_a_file_is_checked_against_all_nodes_of_a_configuration(tmp_path):
    tables = {
        "/sfj/sim": ParameterTable("sim", [Parameter("rate", 500.0), Parameter("seed", 0)]),
        "/control": ParameterTable("control", [Parameter("rate", 500.0), Parameter("law", "a")]),
    }
    good = write(
        tmp_path / "good.yaml",
        "/**:\n  ros__parameters: {rate: 250, law: b}\n/sfj/sim:\n  ros__parameters: {seed: 3}\n",
    )
    assert check_parameter_file(good, tables) == {
        "/sfj/sim": {"rate": 250.0, "seed": 3},
        "/control": {"rate": 250.0, "law": "b"},
    }
    for text, words in [
        ("/**:\n  ros__parameters: {raet: 1}\n", ["raet", "did you mean rate?"]),
        ("/sfj/sim:\n  ros__parameters: {law: a}\n", ["node sim", "law"]),
        ("/sfj/smi:\n  ros__parameters: {seed: 1}\n", ["/sfj/smi", "did you mean sfj/sim?"]),
        ("/**:\n  ros__parameters: {rate: .nan}\n", ["rate", "finite"]),
    ]:
        bad = write(tmp_path / "bad.yaml", text)
        with pytest.raises(ConfigurationError) as caught:
            check_parameter_file(bad, tables)
        for word in [str(bad), *words]:
            assert word in str(caught.value)
