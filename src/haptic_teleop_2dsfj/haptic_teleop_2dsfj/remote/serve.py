"""The command `sfj_board_server`: the loop around `BoardServer`, and its command line.

One thread owns the board and the socket: it waits for the board's sample, sends it, and takes what comes
until the answer is there or time for the next sample. Nothing in it needs POSIX: the vendor's SDK for the Q8
runs on Windows.
"""

from __future__ import annotations

import argparse
import ctypes
import gc
import os
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml

from haptic_teleop_2dsfj.local_board import local_board
from haptic_teleop_2dsfj.remote.key_file import default_key_file, make_key, read_key
from haptic_teleop_2dsfj.remote.link import UdpServer
from haptic_teleop_2dsfj.remote.server import BoardServer
from haptic_teleop_2dsfj.remote.server_settings import NODE, TABLE, ServerSettings, address_of
from haptic_teleop_control.clocks import Clock, SteadyClock
from haptic_teleop_control.command_line import ArgumentParser, run_command
from haptic_teleop_control.device import DeviceError
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.parameter_files import load_parameter_file, parameters_for
from haptic_teleop_control.strict_yaml import parse_value

FLOOD = 64
"""Datagrams taken for one sample at most: who sends more must not keep the loop from its board."""

IDLE = 0.1
"""s between two looks at the socket while there is no board to pace the loop."""

STOPS = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGBREAK")
"""What a system has of these ends the server with its outputs at zero."""


def serve(server: BoardServer, link: UdpServer, clock: Clock, stopped: Callable[[], bool]) -> None:
    """Runs until `stopped()`; the outputs are at zero then."""
    wait, idle = round(server.settings.answer_wait * 1e9), round(IDLE * 1e9)
    try:
        while not stopped():
            if not server.open:
                packet = link.receive(clock.now() + idle)
                if packet is not None:
                    server.take(*packet)
                continue
            server.sample()
            until = clock.now() + wait
            for _ in range(FLOOD):
                packet = link.receive(until if server.awaits_answer else clock.now())
                if packet is None:
                    break
                server.take(*packet)
            server.watch()
    finally:
        server.close()


def read_settings(file: str | None, changes: list[str]) -> dict[str, Any]:
    """All parameters: the section of the file, then `name:=value`. Raises ConfigurationError."""
    found: dict[str, Any] = {}
    if file is not None:
        sections = load_parameter_file(file)
        folder = Path(file).parent
        for key, value in parameters_for(sections, NODE, TABLE).items():
            named = key.endswith(".file") and isinstance(value, str) and value
            found[key] = str(folder / value) if named else value
        if not found or not any("*" not in name for name in sections if NODE in name):
            raise ConfigurationError(
                f"{file}: has no section {NODE}; write `{NODE}:` and its parameters below it."
            )
    stated = TABLE.spelt_out(found, file or "parameters")
    for change in changes:
        name, separator, value = change.partition(":=")
        if not separator:
            raise ConfigurationError(f"-p {change}: is no parameter; write name:=value.")
        try:
            stated |= TABLE.spelt_out({name: parse_value(value)})
        except yaml.YAMLError as error:
            raise ConfigurationError(
                f"-p {change}: what follows := is no value in YAML; quote it."
            ) from error
    return TABLE.check(stated, file or "parameters")


def run(values: dict[str, Any], source: str, stopped: Callable[[], bool]) -> None:
    """Serves with these parameters until `stopped()`. Raises ConfigurationError before anything has moved."""
    settings, clock = ServerSettings.from_parameters(values, source), SteadyClock()
    key = read_key(values["key.file"], make=True)
    emulated = values["device"] == "emulated"
    board = local_board(values, settings.board, clock)
    link = UdpServer(str(address_of(settings.host, "host")), settings.port, clock)
    try:
        peer = str(address_of(settings.peer, "peer"))
        server = BoardServer(board, settings, key, link.send, clock, emulated, peer, _say)
        _prepare_process(values["realtime_priority"])
        try:
            server.open_board()
        except DeviceError as error:
            raise ConfigurationError(
                f"the board cannot be opened: {error}; check cable and power and run `haptic-teleop doctor`, "
                "or set device: emulated."
            ) from error
        kind = "emulated board" if emulated else "board"
        _say(
            f"{kind} {settings.board.card_type} {settings.board.card_identifier} at {settings.board.rate:g} "
            f"Hz, {link.address[0]}:{link.address[1]} for {peer} alone; current to zero after "
            f"{settings.watchdog:g} s without a command; key in {values['key.file'] or default_key_file()}"
        )
        serve(server, link, clock, stopped)
    finally:
        link.close()


def _prepare_process(priority: int) -> None:
    if sys.platform == "win32":
        ctypes.windll.winmm.timeBeginPeriod(1)  # otherwise waits end up to 16 ms late there
    if priority:
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
        except (OSError, AttributeError) as refusal:
            _say(f"no real-time scheduling ({refusal}); on Linux: `ulimit -r 99`, on Windows: `start /high`")
    gc.collect()
    gc.freeze()


def _say(text: str) -> None:
    print(f"{time.strftime('%H:%M:%S')} {text}", flush=True)


def _main(arguments: list[str]) -> int:
    parser = ArgumentParser(
        prog=f"haptic-teleop {NODE}",
        description="Hand the 2DSFJ's board to a driver in another computer (there: board.type: remote). The "
        "current is zero whenever that driver is silent. Needs no ROS.",
        epilog=f"Parameters, in the section {NODE} of FILE or with -p:\n\n" + _parameters(),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "file", nargs="?", metavar="FILE", help="parameter file, such as config/board_server.yaml"
    )
    parser.add_argument(
        "-p",
        dest="changes",
        action="append",
        default=[],
        metavar="NAME:=VALUE",
        help="one parameter; repeatable",
    )
    parser.add_argument("--make-key", metavar="KEY", help="write a new key into the file KEY, and end")
    options = parser.parse_args(arguments)
    if options.make_key is not None:
        make_key(Path(options.make_key))
        print(f"{options.make_key}: a new key; copy it to the other computer on a way that nobody reads")
        return 0
    values = read_settings(options.file, options.changes)
    stopped: list[int] = []

    def stop(number: int, frame: object) -> None:
        if stopped:
            raise KeyboardInterrupt  # asked twice: the board holds the loop, and its watchdog is left with it
        stopped.append(number)

    for name in STOPS:
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), stop)
    run(values, options.file or "parameters", lambda: bool(stopped))
    return 0


def _parameters() -> str:
    return "\n".join(
        f"  {entry.name} ({entry.default!r}{' ' + entry.unit if entry.unit else ''}): {entry.meaning}"
        for entry in TABLE
    )


def main(argv: list[str] | None = None) -> int:
    return run_command(_main, argv)


if __name__ == "__main__":
    sys.exit(main())
