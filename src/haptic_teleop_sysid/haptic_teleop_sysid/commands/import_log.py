"""`haptic-teleop import`: a log (CSV, MATLAB, npz, Parquet, a bag of ROS 1 or 2) becomes a recording.

Where the headers name every column and unit (`time [ms];torque [Nmm];angle [deg]`) no mapping is needed;
otherwise `--suggest` proposes a mapping file to look through. Several logs, or a folder of them, become a
folder of recordings. The recording says what was changed.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from haptic_teleop_control.command_line import ArgumentParser, run_command
from haptic_teleop_control.counted import counted
from haptic_teleop_control.errors import ConfigurationError, HapticTeleopError, RecordingError
from haptic_teleop_control.recording import Recording, write_recording
from haptic_teleop_control.strict_yaml import dump_yaml
from haptic_teleop_sysid.commands.suggest_mapping import suggest
from haptic_teleop_sysid.logs.mapping import Mapping, load_mapping
from haptic_teleop_sysid.logs.opened import imported
from haptic_teleop_sysid.logs.prose import is_prose
from haptic_teleop_sysid.logs.reading import SUFFIXES, ReadOptions
from haptic_teleop_sysid.report import unit_text
from haptic_teleop_sysid.report.terminal import say

PARTLY = 1
"""Exit status where some of several logs became recordings."""
FEW = 4
"""Logs of which each is told as one alone would be."""


def run(argv: list[str]) -> int:
    """Do what the arguments say; returns the exit status."""
    arguments = _parser().parse_args(argv)
    files, passed = logs_in([Path(name) for name in arguments.files])
    rows = None if arguments.rows is None else (arguments.rows[0], arguments.rows[1])
    if rows is not None and not 1 <= rows[0] < rows[1]:
        raise ConfigurationError(f"--rows {rows[0]} {rows[1]}: give the first row, from 1, and a later one.")
    mapping = None if arguments.mapping is None else load_mapping(arguments.mapping)
    definitions = tuple(Path(name) for name in arguments.msg)
    options = ReadOptions(
        None if mapping is None else mapping.stated, rows, arguments.skip_ragged, None, definitions
    )
    if arguments.suggest:
        return suggest(files, options, mapping)
    if arguments.output is None:
        raise ConfigurationError("say with --output where the recording goes, or --suggest a mapping.")
    output = Path(arguments.output)
    if output.exists():
        raise RecordingError(
            f"{output}: it exists already and is not overwritten: name another output, or remove it"
        )
    console, screen = Console(), Console(stderr=True)
    if passed:
        say(screen, f"passed over, being no recording: {', '.join(map(str, passed))}")
    if (len(files) == 1 and not Path(arguments.files[0]).is_dir()) or _is_bag(Path(arguments.files[0])):
        recording = imported(files[0], mapping, options)
        _written(recording, output)
        _tell(recording, output, console, screen)
        return 0
    return _several(files, output, mapping, options, console, screen)


def _several(
    files: list[Path],
    output: Path,
    mapping: Mapping | None,
    options: ReadOptions,
    console: Console,
    screen: Console,
) -> int:
    """One recording for each log; those that cannot be imported are listed and the others go on."""
    failed: dict[Path, str] = {}
    stems = Counter(file.stem for file in files)
    for file in files:
        name = file.stem if stems[file.stem] == 1 else file.name.replace(".", "_")
        try:
            recording = imported(file, mapping, options)
            _written(recording, output / name)
        except HapticTeleopError as error:
            failed[file] = " ".join(str(error).split())
            say(screen, f"failed: {failed[file]}")
            continue
        except Exception as error:  # a defect with one log is no reason to lose the others
            failed[file] = f"{file}: {type(error).__name__}: {error} (a defect of the program: report it)"
            say(screen, f"failed: {failed[file]}")
            continue
        odd = recording.experiment["import"]["odd"]
        if len(files) <= FEW:
            _tell(recording, output / name, console, screen)
            continue
        for line in odd:
            say(screen, f"note: {file}: {line}")
        about = f"{_samples(recording)}" + (f"; {counted(len(odd), 'thing')} to look at" if odd else "")
        say(console, f"{output / name}: {about}")
    say(
        console,
        f"{len(files) - len(failed)} of {len(files)} logs imported into {output}"
        + (f"; {len(failed)} failed: {', '.join(str(f) for f in failed)}" if failed else ""),
    )
    if len(failed) == len(files):
        raise RecordingError(f"none of {len(files)} logs could be imported: see above what each lacks.")
    return PARTLY if failed else 0


def logs_in(paths: Sequence[Path]) -> tuple[list[Path], list[Path]]:
    """The logs that the arguments name: files, bags, and everything in a folder that looks like one or the
    other; and the texts there that do not. ConfigurationError for a folder without any log."""
    found: list[Path] = []
    passed: list[Path] = []
    for path in paths:
        if not path.is_dir() or _is_bag(path):
            found.append(path)
            continue
        here = sorted(p for p in path.iterdir() if _is_bag(p) or p.suffix.lower() in SUFFIXES)
        inside = [p for p in here if not is_prose(p)]
        passed += [p for p in here if p not in inside]
        if not inside:
            raise ConfigurationError(
                f"{path}: no log in it ({', '.join(SUFFIXES)} or a bag): name another folder."
            )
        found += inside
    return found, passed


def _is_bag(path: Path) -> bool:
    return path.is_dir() and (
        (path / "metadata.yaml").is_file() or any(p.suffix in (".mcap", ".db3") for p in path.iterdir())
    )


def _written(recording: Recording, output: Path) -> None:
    write_recording(output, recording.topics, experiment=recording.experiment)


def _samples(recording: Recording) -> str:
    first = next(iter(recording.topics.values()))
    span = float(first.stamp[-1] - first.stamp[0]) * 1e-9
    return f"{len(first)} samples over {span:.6g} s of {', '.join(recording.experiment['import']['units'])}"


def _tell(recording: Recording, output: Path, console: Console, screen: Console) -> None:
    story: dict[str, Any] = recording.experiment["import"]
    for line in (*story["read"], *story["changes"]):
        say(console, line)
    for joint, units in story["units"].items():
        for name, where in story["io"][joint].items():
            series = recording.topics[where["topic"]] if where else None
            if series is None:
                say(screen, f"note: {joint} has no {name}") if name == "input" else None
                continue
            kinds = ("effort",) if name == "input" else ("position", "velocity")
            for kind in kinds:
                values = getattr(series, kind)
                if values is None or not np.any(
                    np.isfinite(column := values[:, series.names.index(where["joint"])])
                ):
                    continue
                unit = units["input"] if name == "input" else units[kind]
                low, high = float(np.nanmin(column)), float(np.nanmax(column))
                what = "input" if name == "input" else f"{name} {kind}"
                say(console, f"{joint} {what}: {low:.6g} to {high:.6g} {unit_text(unit)}")
    for line in story["odd"]:
        say(screen, f"note: {line}")
    say(console, f"recording: {output} ({_samples(recording)})")
    io = dump_yaml(story["io"][next(iter(story["io"]))], default_flow_style=True).strip().replace("\n", " ")
    say(console, f"in a model file: robot: generic, io: {' '.join(io.split())}")


def main(argv: list[str] | None = None) -> int:
    """Entry point: 0 when every log became a recording, 1 when some did, 2 when none did or an argument is
    bad."""
    return run_command(run, argv)


def _parser() -> argparse.ArgumentParser:
    parser = ArgumentParser(
        prog="haptic-teleop import",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog=_MAPPING_HELP,
    )
    add = parser.add_argument
    add("files", nargs="+", metavar="FILE", help="logs, bags, or a folder of them")
    add("--output", metavar="BAG", help="the recording to write; for several logs a folder of recordings")
    add("--mapping", metavar="MAPPING.yaml", help="which column is what")
    add("--suggest", action="store_true", help="print a mapping to look through, and how sure it is")
    add("--rows", nargs=2, type=int, metavar=("FIRST", "LAST"), help="only these rows of a table, from 1")
    add("--skip-ragged", action="store_true", help="leave out rows of another number of cells")
    add("--msg", nargs="+", default=[], metavar="FILE.msg", help="definitions of messages that a bag lacks, "
        "named like package/msg/Type.msg")  # fmt: skip
    return parser


_MAPPING_HELP = """\
a mapping file:
  haptic_teleop_import: 1
  time: {column: t, unit: ms}              # or {rate: 500}; a bag has stamps of its own
  joints:
    elbow:                                 # as many as there are
      input: {column: u, unit: V, gain: 0.36, gain_unit: N*m/V, sign: -1}
      motor:
        position: {column: 3, unit: counts, counts_per_turn: 65536}
        velocity: {column: speed, unit: rpm}
      arm:
        position: {column: link, unit: deg, unwrap: true}     # it jumps from 180 to -180
  read: {delimiter: semicolon, decimal: comma, header: false, skip: 2}    # of text, where it is not seen
columns go by name, or by number from 1; of a bag by topic and field: "/ft:wrench.torque.z",
"/joint_states:position[elbow]". Units: deg, rad, rev, counts, rpm, deg/s, mm, m/s, N*mm, N, mA, V, %, ...
"""


if __name__ == "__main__":
    raise SystemExit(main())
