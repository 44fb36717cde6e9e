"""The nodes as executables: help, refused parameters, and an end that leaves zero behind."""

import subprocess
import sys
from pathlib import Path

import pytest

from haptic_teleop_control.front_door import load
from haptic_teleop_control.nodes.base.registry import node_class, node_names
from haptic_teleop_control.nodes.composed import main as composed

NODES = ("signal_generator", "force_controller", "sfj_sim", "omni_sim")


def write(folder: Path, text: str) -> str:
    file = folder / "parameters.yaml"
    file.write_text(text)
    return str(file)


def run(name: str, *arguments: str) -> int:
    return load(name)(list(arguments))


@pytest.mark.parametrize("name", NODES)
def test_help_prints_topics_and_every_parameter(name, capsys):
    assert run(name, "--help") == 0
    text = capsys.readouterr().out
    assert "publishes" in text
    for parameter in node_class(name).TABLE:
        assert f"  {parameter.name} [" in text


@pytest.mark.parametrize("name", node_names())
def test_help_fits_a_narrow_terminal_and_loses_no_word(name, capsys, monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    run(name, "--help")
    wide = capsys.readouterr().out
    monkeypatch.setenv("COLUMNS", "80")
    run(name, "--help")
    narrow = capsys.readouterr().out
    assert max(map(len, narrow.splitlines())) <= 80
    assert narrow.split() == wide.split()


@pytest.mark.parametrize("name", NODES)
@pytest.mark.parametrize("section", ["{name}", "/**", "/{full}"])
def test_an_unknown_key_in_a_parameter_file_is_refused_by_file_and_key(name, section, tmp_path, capsys):
    node = node_class(name)
    full = f"{node.NAMESPACE}/{name}".lstrip("/")
    file = write(
        tmp_path, section.format(name=name, full=full) + ":\n  ros__parameters:\n    no_such_key: 1\n"
    )
    assert run(name, "--ros-args", "--params-file", file) == 2
    error = capsys.readouterr().err.strip()
    assert len(error.splitlines()) == 1
    assert file in error
    assert "no_such_key" in error


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["--ros-args", "-p", "timeout:=.nan"], "timeout"),
        (["--ros-args", "-p", "timeout:=5.0"], "timeout"),
        (["--ros-args", "-p", "timeout:=[1"], "timeout:=[1"),
        (["--ros-args", "-p", "timeout:="], "timeout"),
        (["--ros-args", "-p", "master:=falcon"], "master"),
        (["--ros-args", "-p", "stage1.kp:=much"], "stage1.kp"),
        (["--ros-args", "-p", "tiemout:=0.1"], "timeout"),
        (["--ros-args", "-p", "master:=sfj", "-p", "slave:=sfj"], "both sfj"),
        (["--ros-args", "--params-file"], "--params-file"),
        (["--ros-args", "--params-file", "/no/such/file.yaml"], "/no/such/file.yaml"),
        (["--ros-args", "-p", "timeout"], "timeout"),
        (["--gain", "2"], "--gain"),
    ],
)
def test_a_bad_argument_is_one_sentence_and_status_2(arguments, named, capsys):
    assert run("force_controller", *arguments) == 2
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert error.startswith("error: ")
    assert named in error


def test_a_model_file_is_looked_for_beside_the_parameter_file(tmp_path, capsys):
    file = write(tmp_path, "sfj_sim:\n  ros__parameters:\n    stage1.model: mine.yaml\n")
    assert run("sfj_sim", "--ros-args", "--params-file", file) == 2
    assert str(tmp_path / "mine.yaml") in capsys.readouterr().err


REFUSES = """
import ctypes, sys
from rclpy.node import Node
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.nodes import signal_generator

def hang(*_):
    ctypes.PyDLL(None).pause()  # for good, and it holds the interpreter

Node.destroy_node = hang
signal_generator.NODE.start = lambda self: self.fail(ConfigurationError("it may not take part."))
sys.exit(signal_generator.main([]))
"""
"""A node that is refused only once it runs, in a middleware that hangs while it leaves."""


def test_a_refusal_is_told_with_status_2_though_the_middleware_does_not_let_go():
    command = [sys.executable, "-c", REFUSES]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2, done.stderr
    assert done.stderr.splitlines()[-1] == "error: it may not take part."


def test_composed_refuses_nodes_that_run_in_two_times(tmp_path, capsys):
    mixed = tmp_path / "mixed.yaml"
    mixed.write_text("sfj_sim:\n  ros__parameters: {use_sim_time: true}\n", encoding="utf-8")
    arguments = ["sfj_sim", "force_controller", "--ros-args", "--params-file", str(mixed)]
    assert composed(arguments) == 2
    said = capsys.readouterr().err
    assert "sfj_sim runs in simulated time and force_controller does not" in said
    assert "set use_sim_time alike" in said


def test_composed_knows_every_node_and_refuses_what_is_none(capsys):
    assert set(NODES) <= set(node_names())
    assert composed(["--help"]) == 0
    assert composed([]) == 2
    assert composed(["recorder"]) == 2
    assert composed(["compare"]) == 2
    assert composed(["sfj_sim", "sfj_sim"]) == 2
    assert "twice" in capsys.readouterr().err
