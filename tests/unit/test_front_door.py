"""The one command on the PATH: what it lists, starts, refuses and completes."""

import os
import re
import shutil
import subprocess
import sys
import types
from pathlib import Path

import pytest

from haptic_teleop_control import compiled, front_door

WIDE = {name: value for name, value in os.environ.items() if name != "COLUMNS"}
COMMAND = Path(sys.executable).with_name("haptic-teleop")


def run(*arguments: str, **options) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(COMMAND), *arguments],
        **{"capture_output": True, "text": True, "timeout": 30, "check": False, "env": WIDE, **options},
    )


@pytest.fixture
def probe(monkeypatch: pytest.MonkeyPatch) -> types.ModuleType:
    """An executable `probe` that remembers its arguments and what it saw, and returns 7."""
    module = types.ModuleType("haptic_teleop_probe")
    module.calls = []

    def main(argv: list[str]) -> int:
        module.calls.append((argv, list(sys.argv), os.environ.get("AMENT_PREFIX_PATH")))
        return 7

    module.main = main
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setattr(sys, "argv", ["before"])
    registry = {"haptic_teleop_control": {"probe": ("haptic_teleop_probe:main", "a probe")}}
    monkeypatch.setattr(front_door, "registries", lambda: registry)
    return module


def test_without_arguments_and_with_help_it_lists_every_executable_with_its_line_under_its_package():
    plain, asked = run(), run("--help")
    assert (plain.returncode, asked.returncode) == (0, 0)
    assert plain.stdout == asked.stdout
    sections = re.split(r"^(haptic_teleop_\w+):$", plain.stdout, flags=re.MULTILINE)
    listed = dict(zip(sections[1::2], sections[2::2], strict=True))
    assert list(listed) == list(front_door.PACKAGES)
    for package, entries in front_door.registries().items():
        for name, (_, line) in entries.items():
            assert re.search(rf"^  {name} +{re.escape(line)}$", listed[package], re.MULTILINE)


def test_it_says_once_when_something_is_compiled_and_leaves_nodes_to_scenario(probe, monkeypatch, capsys):
    def compiles(argv: list[str]) -> int:
        for tell in [*compiled._told] * 2:
            tell()
        return 0

    probe.main = compiles
    assert front_door.start("probe", []) == 0
    assert capsys.readouterr().err == "compiling, once, some 20 s\n"
    assert not compiled.is_told()
    monkeypatch.setitem(sys.modules, "haptic_teleop_probe.nodes.probe", probe)
    registry = {"haptic_teleop_control": {"probe": ("haptic_teleop_probe.nodes.probe:main", "a node")}}
    monkeypatch.setattr(front_door, "registries", lambda: registry)
    monkeypatch.setattr(front_door, "load", lambda name: compiles)
    assert front_door.start("probe", []) == 0
    assert not capsys.readouterr().err


def test_the_list_fits_a_narrow_terminal_and_loses_no_word(monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    whole = front_door.listing()
    monkeypatch.setenv("COLUMNS", "80")
    narrow = front_door.listing()
    assert max(map(len, narrow.splitlines())) <= 80 < max(map(len, whole.splitlines()))
    assert narrow.split() == whole.split()


def test_listing_imports_nothing_beyond_the_standard_library_but_the_project():
    # What makes the list slow is what it imports: how long that takes is the machine's.
    code = (
        "import sys; before = set(sys.modules);"
        "from haptic_teleop_control import front_door; front_door.listing();"
        "new = {m.partition('.')[0] for m in set(sys.modules) - before} - set(sys.stdlib_module_names);"
        "print(sorted(m for m in new if not m.startswith(('haptic_teleop', '_'))))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_arguments_reach_the_executable_untouched_and_its_status_comes_back(probe):
    arguments = ["--ros-args", "-p", "rate:=500.0", "--", "--help", "a b"]
    assert front_door.main(["probe", *arguments]) == 7
    argv, process_argv, _ = probe.calls[0]
    assert argv == arguments
    assert process_argv[1:] == arguments


def test_help_after_the_name_belongs_to_the_executable(probe):
    assert front_door.main(["probe", "--help"]) == 7


def test_the_environment_becomes_the_ament_prefix_where_none_is_set(probe, monkeypatch):
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    front_door.main(["probe"])
    monkeypatch.setenv("AMENT_PREFIX_PATH", "/opt/ros/some")
    front_door.main(["probe"])
    assert [prefix for _, _, prefix in probe.calls] == [sys.prefix, "/opt/ros/some"]


@pytest.mark.parametrize(
    ("typed", "meant"),
    [("comapre", "compare"), ("sfj-sim", "sfj_sim"), ("Recorder", "recorder"), ("Plot", "preview")],
)
def test_a_mistyped_name_is_refused_in_one_sentence_with_the_nearest_one(typed, meant):
    done = run(typed)
    assert done.returncode == 2
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1
    assert typed in done.stderr
    assert f"'{meant}'" in done.stderr


def test_what_people_call_by_another_word_is_there_and_the_word_is_none_of_its_own():
    known = front_door.executables()
    assert set(front_door.MEANT.values()) <= set(known)
    assert not set(front_door.MEANT) & set(known)


UNKNOWN = [("xyzzy",), ("--colour",), ("--completion",), ("--completion", "tcsh")]


@pytest.mark.parametrize("arguments", UNKNOWN)
def test_what_it_does_not_know_is_refused_in_one_sentence(arguments):
    done = run(*arguments)
    assert (done.returncode, done.stdout, len(done.stderr.splitlines())) == (2, "", 1)


def test_a_missing_ros_is_one_sentence_with_the_remedy(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "haptic_teleop_needs_ros", None)
    registry = {"haptic_teleop_control": {"node": ("haptic_teleop_needs_ros:main", "a node")}}
    monkeypatch.setattr(front_door, "registries", lambda: registry)

    def without_ros(name: str):
        raise ModuleNotFoundError("No module named 'rclpy.node'", name="rclpy.node")

    monkeypatch.setattr(front_door.importlib, "import_module", without_ros)
    assert front_door.main(["node"]) == 2
    message = capsys.readouterr().err
    assert len(message.splitlines()) == 1
    assert "rclpy" in message
    assert "make setup" in message


@pytest.mark.parametrize("arguments", [["echo", "/x"], ["set", "a", "b", "1.0"], ["operate", "state"]])
def test_a_missing_ros_is_told_by_commands_that_load_it_late(monkeypatch, capsys, arguments):
    monkeypatch.setitem(sys.modules, "rclpy", None)
    for name in [name for name in sys.modules if name.startswith("haptic_teleop_control.nodes")]:
        monkeypatch.delitem(sys.modules, name)
    assert front_door.main(arguments) == 2
    assert f"{arguments[0]} needs ROS 2" in capsys.readouterr().err



def test_any_other_missing_module_is_a_defect_and_keeps_its_traceback(monkeypatch):
    registry = {"haptic_teleop_control": {"broken": ("haptic_teleop_no_such_module:main", "broken")}}
    monkeypatch.setattr(front_door, "registries", lambda: registry)
    with pytest.raises(ModuleNotFoundError):
        front_door.main(["broken"])


def test_version_is_the_one_of_the_packages(repository):
    manifest = (repository / "src/haptic_teleop_control/package.xml").read_text()
    assert run("--version").stdout == f"haptic-teleop {re.search('<version>(.*)</version>', manifest)[1]}\n"


def test_a_reader_that_closes_the_pipe_hears_no_complaint():
    done = subprocess.run(
        ["bash", "-c", f"set -o pipefail; {COMMAND} | :"], capture_output=True, text=True, check=False
    )
    assert done.stderr == ""


def complete_in_bash(*words: str) -> list[str]:
    """What bash offers when TAB is pressed at the end of `words`."""
    script = f"""
        eval "$({COMMAND} --completion bash)"
        COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1))
        _haptic_teleop
        printf '%s\\n' "${{COMPREPLY[@]}}"
    """
    done = subprocess.run(["bash", "-c", script, "bash", *words], capture_output=True, text=True, check=True)
    return done.stdout.split()


def test_bash_completes_names_then_options_and_files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model.yaml").touch()
    assert set(front_door.executables()) < set(complete_in_bash("haptic-teleop", ""))
    assert complete_in_bash("haptic-teleop", "comp") == ["composed", "compare"]
    assert complete_in_bash("haptic-teleop", "compare", "mod") == ["model.yaml"]
    assert complete_in_bash("haptic-teleop", "sfj_sim", "--ros") == ["--ros-args"]


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_the_other_shells_accept_their_script_and_it_names_every_executable(shell, tmp_path):
    script = run("--completion", shell).stdout
    assert all(name in script for name in front_door.executables())
    if program := shutil.which(shell):  # its syntax can be checked only where the shell is
        path = tmp_path / "completion"
        path.write_text(script)
        subprocess.run([program, "-n", str(path)], check=True)
