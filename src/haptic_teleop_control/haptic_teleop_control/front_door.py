"""`haptic-teleop EXECUTABLE [arguments]`: the one command on the PATH of a plain environment.

It starts any executable of the five packages with the arguments that `ros2 run` would pass it. Names such as
`compare` would shadow other programs if each were on the PATH.
"""

import difflib
import importlib
import importlib.metadata
import importlib.util
import os
import shutil
import signal
import sys
import textwrap
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from haptic_teleop_control.command_line import INTERRUPTED, run_command
from haptic_teleop_control.completion import SHELLS, completion_script
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.private_folder import refuse_untrusted_numba_cache

PROGRAM = "haptic-teleop"
PACKAGES = (
    "haptic_teleop_control",
    "haptic_teleop_sim",
    "haptic_teleop_sysid",
    "haptic_teleop_omni",
    "haptic_teleop_2dsfj",
)
# Top-level modules that come with ROS 2 and not with our plain dependencies.
ROS_MODULES = ("rclpy", "rcl_interfaces", "builtin_interfaces", "ament_index_python", "rpyutils")


def registries() -> dict[str, dict[str, tuple[str, str]]]:
    """The executables by package: package -> {name: ("module:function", "one line")}.

    A package that is not installed is left out, as in a colcon workspace where only some were built. Only the
    packages' `executables` modules are read, which import nothing, so this takes milliseconds.
    """
    return {
        package: importlib.import_module(f"{package}.executables").EXECUTABLES
        for package in PACKAGES
        if importlib.util.find_spec(package) is not None
    }


def executables() -> dict[str, tuple[str, str]]:
    """All executables: name -> ("module:function", "one line"), in the order of the listing."""
    return {name: entry for entries in registries().values() for name, entry in entries.items()}


def listing() -> str:
    """What `haptic-teleop` alone prints: usage, then every executable with its line, grouped by package; in
    the terminal's width, and one line each where it goes into a file or a pipe."""
    width = max(len(name) for name in executables())
    available = shutil.get_terminal_size((1000, 24)).columns

    def told(begin: str, text: str) -> str:
        return textwrap.fill(
            text, max(available, width + 24), initial_indent=begin, subsequent_indent=" " * len(begin),
            break_long_words=False, break_on_hyphens=False,
        )  # fmt: skip

    lines = [
        f"usage: {PROGRAM} EXECUTABLE [arguments]",
        "",
        told("", "Starts an executable with the arguments of `ros2 run PACKAGE EXECUTABLE`, --ros-args too."),
        f"`{PROGRAM} EXECUTABLE --help` explains its own arguments.",
    ]
    for package, entries in registries().items():
        lines += ["", f"{package}:"]
        lines += [told(f"  {name:{width}}  ", line) for name, (_, line) in entries.items()]
        if not entries:
            lines.append("  (no executable yet)")
    lines += [
        "",
        "options:",
        "  -h, --help                    this list",
        "  --version                     the version",
        f"  --completion {{{','.join(SHELLS)}}}  a script that completes names in that shell",
    ]
    return "\n".join(lines)


#: Which executable does what people call by another word.
MEANT = {
    "calibrate": "stiffness",
    "check": "doctor",
    "convert": "import",
    "draw": "preview",
    "fit": "estimate",
    "identify": "estimate",
    "launch": "scenario",
    "listen": "echo",
    "param": "set",
    "plot": "preview",
    "record": "acquire",
    "report": "verify",
    "run": "scenario",
    "simulate": "lockstep",
    "start": "scenario",
    "validate": "verify",
}


def version() -> str:
    """The version that is installed: from a plain environment or from a colcon workspace."""
    for distribution in (PROGRAM, PACKAGES[0]):
        try:
            return importlib.metadata.version(distribution)
        except importlib.metadata.PackageNotFoundError:
            continue
    return "unknown (not installed)"


def load(name: str) -> Callable[[list[str]], int | None]:
    """The `main(argv)` of an executable, imported.

    Raises ConfigurationError for an unknown name (with the nearest known one) and when ROS 2 is missing.
    """
    known = executables()
    if name not in known:
        typed = name.replace("-", "_").lower()
        near = [MEANT[typed]] if typed in MEANT else difflib.get_close_matches(typed, known, n=1, cutoff=0.5)
        hint = f"did you mean {near[0]!r}?" if near else "it knows none that resembles it;"
        raise ConfigurationError(f"unknown executable {name!r}: {hint} `{PROGRAM}` alone lists all of them")
    module, function = known[name][0].split(":")
    try:
        return getattr(importlib.import_module(module), function)
    except ModuleNotFoundError as error:
        _tell_if_ros_is_missing(name, error)
        raise


def _tell_if_ros_is_missing(name: str, error: ModuleNotFoundError) -> None:
    """Raises ConfigurationError, with the remedy, where what is missing is a part of ROS 2."""
    missing = (error.name or "").split(".")[0]
    if missing in ROS_MODULES or missing.endswith(("_msgs", "_srvs")):
        raise ConfigurationError(
            f"{name} needs ROS 2 and Python finds no {missing!r}:"
            f" run `make setup` and use .venv/bin/{PROGRAM}, or source a ROS 2 installation"
        ) from error


@contextmanager
def _saying_when_it_compiles(name: str) -> Iterator[None]:
    """Says once on standard error that something is compiled: the first run after the installation is silent
    for up to a minute without that. Nodes tell `scenario`, which tells of it."""
    try:
        from haptic_teleop_control.compiled import telling_compilation
    except ImportError:  # Windows, where the server of a board runs: nothing is compiled there
        yield
        return
    told = ".nodes." in executables()[name][0]

    def tell() -> None:
        nonlocal told
        if not told:
            told = True
            print("compiling, once, some 20 s", file=sys.stderr, flush=True)

    with telling_compilation(tell):
        yield


def start(name: str, arguments: Sequence[str]) -> int:
    """Run an executable in this process with its arguments untouched, and return its exit status."""
    # The ROS 2 wheels make the environment an ament prefix. A sourced installation has set its own.
    os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)
    # Matrices here have six rows: threads of the linear algebra library would only spin against each other
    # and the control loops (measured: 24 ms instead of 0.3 ms for an observer gain on two busy cores).
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    refuse_untrusted_numba_cache()
    try:
        main_of_executable = load(name)
    except KeyboardInterrupt:
        raise KeyboardInterrupt("interrupted before it began; nothing was written") from None
    # What asks for the process' own arguments (argparse for the program's name, rclpy.init) must see the
    # executable's.
    sys.argv = [f"{PROGRAM} {name}", *arguments]
    try:
        with _saying_when_it_compiles(name):
            return run_command(main_of_executable, list(arguments))
    except ModuleNotFoundError as error:  # of what a command loads when it knows that it needs it
        _tell_if_ros_is_missing(name, error)
        raise


def _front_door(arguments: list[str]) -> int:
    first = arguments[0] if arguments else "--help"
    if first in ("-h", "--help"):
        print(listing())
    elif first == "--version":
        print(f"{PROGRAM} {version()}")
    elif first == "--completion":
        shell = arguments[1] if len(arguments) > 1 else ""
        print(completion_script(shell, {name: line for name, (_, line) in executables().items()}))
    elif first.startswith("-"):
        raise ConfigurationError(f"unknown option {first!r}: options of an executable come after its name")
    else:
        return start(first, arguments[1:])
    return 0


def main(argv: Sequence[str] | None = None) -> int:
    """The command: list, complete, or start; returns the exit status (2: a mistake in the command line)."""
    status = run_command(_front_door, argv)
    if argv is None and status == INTERRUPTED:
        # All that another Ctrl-C could still interrupt is Python's own end, which would print a traceback.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    return status


if __name__ == "__main__":
    sys.exit(main())
