"""What a command says and returns when something goes wrong."""

import argparse

import pytest

from haptic_teleop_control import errors, operate
from haptic_teleop_control.command_line import ArgumentParser, run_command

KINDS = [errors.ConfigurationError, errors.ModelError, errors.RecordingError, errors.MismatchError]


def raising(error: BaseException):
    def main(argv: list[str]) -> int:
        raise error

    return main


@pytest.mark.parametrize("kind", KINDS)
def test_a_mistake_of_the_user_is_one_line_and_status_2(kind, capsys):
    assert run_command(raising(kind("model.yaml: no key\n 'stiffness': add it")), []) == 2
    captured = capsys.readouterr()
    assert captured.err == "error: model.yaml: no key 'stiffness': add it\n"
    assert captured.out == ""


@pytest.mark.parametrize("kind", KINDS)
def test_every_error_is_ours_and_a_value_error(kind):
    assert issubclass(kind, errors.HapticTeleopError)
    assert issubclass(kind, ValueError)


def test_a_defect_of_the_program_passes_through():
    with pytest.raises(ZeroDivisionError):
        run_command(raising(ZeroDivisionError()), [])


@pytest.mark.parametrize(("result", "status"), [(None, 0), (0, 0), (3, 3)])
def test_the_result_is_the_status(result, status):
    assert run_command(lambda argv: result, []) == status


@pytest.mark.parametrize(("arguments", "status"), [(["--help"], 0), (["--unknown"], 2)])
def test_leaving_through_argparse_is_a_status(arguments, status, capsys):
    def main(argv: list[str]) -> None:
        argparse.ArgumentParser(prog="x").parse_args(argv)

    assert run_command(main, arguments) == status


@pytest.mark.parametrize(("code", "status"), [(None, 0), (4, 4), ("a reason", 1)])
def test_sys_exit_means_what_python_says_it_means(code, status):
    assert run_command(raising(SystemExit(code)), []) == status


@pytest.mark.parametrize(
    ("typed", "hint"), [("engag", "did you mean engage?"), ("fly", "choose from engage, disengage")]
)
def test_a_mistyped_act_of_operate_is_told_with_the_nearest(typed, hint, capsys):
    assert operate.main([typed]) == 2
    assert hint in capsys.readouterr().err


def options() -> ArgumentParser:
    parser = ArgumentParser(prog="haptic-teleop x")
    parser.add_argument("--output", required=True)
    parser.add_argument("--to", choices=("mujoco", "urdf"))
    parser.add_argument("--number", type=int)
    return parser


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--ouput", "d"], "unknown option --ouput: did you mean --output?"),
        (["--output", "d", "--ouput=e"], "unknown option --ouput: did you mean --output?"),
        (["--output", "d", "--zzz"], "unknown option --zzz; `haptic-teleop x --help` tells more"),
        (["--output", "d", "--to", "mujco"], "argument --to: 'mujco' is not known: did you mean mujoco?"),
        ([], "the following arguments are required: --output; `haptic-teleop x --help` tells more"),
    ],
)
def test_a_mistake_in_the_command_line_is_one_line_with_the_nearest_that_there_is(arguments, said, capsys):
    assert run_command(lambda argv: options().parse_args(argv) and 0, arguments) == 2
    assert capsys.readouterr().err == f"error: {said}\n"


@pytest.mark.parametrize("arguments", [["--outp", "d"], ["--output=d", "--number", "-3"], ["--output", "-"]])
def test_what_argparse_takes_is_taken(arguments):
    assert options().parse_args(arguments).output in ("d", "-")


def test_interrupting_says_what_the_interrupt_carries_and_no_more(capsys):
    assert run_command(raising(KeyboardInterrupt()), []) == 130
    assert capsys.readouterr().err == ""
    assert run_command(raising(KeyboardInterrupt("interrupted;\nnothing was written")), []) == 130
    assert capsys.readouterr().err.strip() == "interrupted; nothing was written"


def test_without_arguments_it_takes_those_of_the_process(monkeypatch):
    monkeypatch.setattr("sys.argv", ["program", "a", "b"])
    seen = []
    run_command(lambda argv: seen.extend(argv), None)
    assert seen == ["a", "b"]
