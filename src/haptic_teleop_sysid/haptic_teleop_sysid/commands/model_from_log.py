"""`haptic-teleop model`: a model file to start from, out of recordings or logs: structure, io and parameters
by band-limited least squares, so that no inertia has to be invented. Every joint gets its model.
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from rich.console import Console

from haptic_teleop_control.command_line import ArgumentParser, run_command
from haptic_teleop_control.errors import ConfigurationError, HapticTeleopError, RecordingError
from haptic_teleop_control.recording import Recording
from haptic_teleop_sim.model import STRUCTURES
from haptic_teleop_sysid.commands.treatment_options import add_mapping_option
from haptic_teleop_sysid.logs.opened import open_recording
from haptic_teleop_sysid.logs.story import tell
from haptic_teleop_sysid.recordings.parameter_units import Units
from haptic_teleop_sysid.recordings.recorded_parameters import recorded_units
from haptic_teleop_sysid.report import with_error
from haptic_teleop_sysid.report.output import refuse_inputs
from haptic_teleop_sysid.report.terminal import say
from haptic_teleop_sysid.results import tool_version
from haptic_teleop_sysid.starting_model.joints import joints_in
from haptic_teleop_sysid.starting_model.model import StartingModel, starting_model

PARTLY = 1
"""Exit status where some of several joints have no model."""
WIDE = 10.0
"""Factor by which the bounds in a model file's comment leave a parameter room."""


def run(argv: list[str]) -> int:
    """Do what the arguments say; returns the exit status."""
    arguments = _parser().parse_args(argv)
    console, screen = Console(), Console(stderr=True)
    with screen.status("reading"):
        recordings = {name: open_recording(name, arguments.mapping) for name in dict.fromkeys(arguments.logs)}
    tell(screen, {name: recording.experiment for name, recording in recordings.items()}, arguments.verbose)
    for name, recording in recordings.items():
        for odd in recording.experiment.get("import", {}).get("odd", ()):
            say(screen, f"note: {name}: {odd}")
    first = next(iter(recordings))
    joints = joints_in(recordings[first], first)
    if any(topic.startswith(("/sfj/", "/omni/")) for topic in recordings[first].topics):
        raise ConfigurationError(
            f"{first} is of the 2DSFJ or the Omni: their models are in config/models: start from one."
        )
    if arguments.joint is not None and arguments.joint not in joints:
        raise ConfigurationError(f"{first} has no joint {arguments.joint!r}: it has {', '.join(joints)}.")
    wanted = list(joints) if arguments.joint is None else [arguments.joint]
    output = Path(arguments.output)
    paths = {
        j: output if len(wanted) == 1 else output.with_name(f"{output.stem}_{_word(j)}{output.suffix}")
        for j in wanted
    }
    for path in paths.values():
        refuse_inputs(path, [*arguments.logs, *filter(None, [arguments.mapping])])
        if path.exists() and not arguments.overwrite:
            raise ConfigurationError(f"{path} exists already: name another --output, or say --overwrite.")
    failed: list[str] = []
    for joint, path in paths.items():
        try:
            found = starting_model(recordings, joint, joints[joint], arguments.structure)
        except HapticTeleopError as error:
            if len(paths) == 1:
                raise
            failed.append(joint)
            say(screen, f"failed: {joint}: {' '.join(str(error).split())}")
            continue
        units = recorded_units(recordings[first].experiment, str(joints[joint]["motor"]["joint"]))
        lines = lines_of(found, units)
        try:
            found.model.save(path, [*_origin(recordings), *lines, *bounds_of(found)])
        except OSError as error:
            raise ConfigurationError(f"{path} cannot be written ({error}): name another --output.") from error
        for line in lines:
            say(console, line)
        say(console, f"model: {path}")
    if len(failed) == len(paths):
        raise RecordingError(f"{first}: no joint of it gives a model: see above what each lacks.")
    return PARTLY if failed else 0


def lines_of(found: StartingModel, units: dict[str, str]) -> list[str]:
    """What to know of a model, in lines."""
    model, known = found.model, Units(units["position"], units["input"])
    lines = [f"{model.joint}: {model.structure}, by least squares below {found.cutoff:.3g} Hz"]
    # Least squares know an error only of a model that is right; a start is made because nobody knows that.
    for name in found.std:
        lines.append(f"  {name} {with_error(model.parameters[name], None, known.of_parameter(model, name))}")
    lines.append(f"  fit of the input: {found.percent:.1f} %")
    if found.percent_beside > found.percent + 1.0:
        beside = ", ".join(f"{n} {v:.4g}" for n, v in found.beside.items())
        lines.append(
            f"  with {beside} beside it would be {found.percent_beside:.1f} %: `diagnose` says what "
            "is missing"
        )
    lines.append("  values to start from; `estimate` says how sure they are")
    return lines + [f"  {one}" for one in found.told]


def bounds_of(found: StartingModel) -> list[str]:
    """Bounds for `estimate` that leave every parameter a factor of WIDE on either side."""
    free = {n: v for n, v in found.model.parameters.items() if n not in found.model.fixed}
    bounds = " ".join(f"{n}={v / WIDE:.3g}:{v * WIDE:.3g}" for n, v in free.items())
    return [f"bounds for `estimate`, a factor of {WIDE:g} either way: --bound {bounds}"]


def _origin(recordings: dict[str, Recording]) -> list[str]:
    """What a model was made from, in lines."""
    lines = [
        f"By `haptic-teleop model` {tool_version()}, to start from: it is no estimate, and knows no noise."
    ]
    for name, recording in recordings.items():
        story = recording.experiment.get("import")
        story = story if isinstance(story, dict) else {}
        digest = f", SHA-256 {story['sha256']}" if "sha256" in story else ""
        file = f", of {story['file']}" if digest and story["file"] != Path(name).name else ""
        lines.append(f"from {Path(name).name}{file}{digest}")
        lines += [f"note: {odd}" for odd in story.get("odd", ())]
    return lines


def main(argv: list[str] | None = None) -> int:
    """Entry point: 0 when every joint has a model, 1 when some have, 2 when none has."""
    return run_command(run, argv)


def _word(joint: str) -> str:
    """A joint's name as part of a file's name."""
    return re.sub(r"[^A-Za-z0-9.-]+", "_", joint)


def _parser() -> argparse.ArgumentParser:
    parser = ArgumentParser(prog="haptic-teleop model", description=__doc__)
    add = parser.add_argument
    add(
        "--from",
        nargs="+",
        required=True,
        dest="logs",
        metavar="LOG",
        help="recordings or logs of the same joints",
    )
    add("--output", required=True, metavar="MODEL.yaml", help="for several joints MODEL_<joint>.yaml each")
    add("--structure", choices=tuple(STRUCTURES), help="default: flexible_joint where an arm moves by itself")
    add("--joint", metavar="NAME", help="this joint alone")
    add("--overwrite", action="store_true", help="replace an existing file")
    add_mapping_option(parser)
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
