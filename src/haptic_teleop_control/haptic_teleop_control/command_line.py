"""What every command does about errors: a sentence for the user's, a traceback for ours."""

import argparse
import difflib
import math
import os
import sys
from collections.abc import Callable, Collection, Sequence
from typing import Any, NoReturn

from haptic_teleop_control.errors import ConfigurationError, HapticTeleopError
from haptic_teleop_control.interrupts import nothing_swallowed

USAGE_ERROR = 2
INTERRUPTED = 130  # 128 + SIGINT, what a shell reports for a command stopped with Ctrl-C
PIPE_CLOSED = 141  # 128 + SIGPIPE


def run_command(main: Callable[[list[str]], int | None], argv: Sequence[str] | None = None) -> int:
    """Run the body of a command and return its exit status.

    `main` receives the arguments without the program's name, those of the process when `argv` is None; its
    result is the exit status, None meaning 0. A `HapticTeleopError` becomes one line on standard error and
    status 2; leaving through `argparse` (`--help` is 0, a bad argument 2) becomes that status; Ctrl-C,
    wherever it comes, becomes 130, with the sentence that the interrupt carries, if any, and a reader that
    closed our output (`| head`) 141, silently. Any other exception passes through: it is a defect of the
    program, and Python then prints the traceback and exits with 1.
    """
    try:
        with nothing_swallowed():
            status = main(list(sys.argv[1:] if argv is None else argv))
        sys.stdout.flush()  # here, so that a closed pipe is met inside this `try`
    except HapticTeleopError as error:
        return tell(error)
    except SystemExit as leaving:
        return _status_of(leaving)
    except KeyboardInterrupt as leaving:
        if leaving.args:
            print(f"\n{' '.join(str(leaving).split())}", file=sys.stderr)  # below a shell's ^C
        return INTERRUPTED
    except BrokenPipeError:
        # Python flushes standard output once more while it exits, and would complain about the same pipe.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return PIPE_CLOSED
    return 0 if status is None else status


class ArgumentParser(argparse.ArgumentParser):
    """As argparse's, but a mistake is one sentence that names the nearest option or choice, raised as
    ConfigurationError; an unknown option is told of before what is missing, for it is mostly that."""

    def parse_known_args(  # pyright: ignore[reportIncompatibleMethodOverride]: argparse has overloads
        self, args: Any = None, namespace: Any = None
    ) -> Any:
        given = sys.argv[1:] if args is None else list(args)
        for text in given[: given.index("--") if "--" in given else None]:
            name = text.partition("=")[0]
            known = self._option_string_actions
            if name.startswith("--") and name not in known and not self._get_option_tuples(name):
                near = difflib.get_close_matches(name.lower(), known, n=1)
                self.error(f"unknown option {name}" + (f": did you mean {near[0]}?" if near else ""))
        return super().parse_known_args(given, namespace)

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            raise argparse.ArgumentError(action, _not_known(value, [str(c) for c in action.choices]))

    def error(self, message: str) -> NoReturn:
        """Raise ConfigurationError with the message, and where the options are told."""
        more = "" if message.endswith("?") else f"; `{self.prog} --help` tells more"
        raise ConfigurationError(f"{message}{more}")


def _not_known(value: object, known: Collection[str]) -> str:
    near = difflib.get_close_matches(str(value).lower(), known, n=1)
    hint = f"did you mean {near[0]}?" if near else f"choose from {', '.join(known)}"
    return f"{str(value)!r} is not known: {hint}"


def one_of(known: Collection[str]) -> Callable[[str], str]:
    """An argument's type for `argparse`: one of the known words; another one is refused with the nearest."""

    def word(text: str) -> str:
        if text in known:
            return text
        raise argparse.ArgumentTypeError(_not_known(text, known))

    return word


def tell(error: HapticTeleopError) -> int:
    """Prints the error to standard error, in one line even if a library's message is quoted in it, because
    scripts show the last line; before it, as notes, what was added to it (`add_note`) on its way. Returns the
    exit status, USAGE_ERROR."""
    for note in getattr(error, "__notes__", ()):
        print(f"note: {' '.join(note.split())}", file=sys.stderr)
    print(f"error: {' '.join(str(error).split())}", file=sys.stderr)
    return USAGE_ERROR


def _status_of(leaving: SystemExit) -> int:
    """The exit status that Python itself would give: None is 0, a text goes to standard error and is 1."""
    if leaving.code is None:
        return 0
    if isinstance(leaving.code, int):
        return leaving.code
    print(leaving.code, file=sys.stderr)
    return 1


def positive(text: str) -> float:
    """The number above zero that an argument is: a `type` of argparse, which tells what is wrong with it."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number above zero")
    return value
