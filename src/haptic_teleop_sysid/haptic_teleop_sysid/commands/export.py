"""`haptic-teleop export`: a model as MJCF, URDF or one Python function, and what the target cannot say."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

from rich.console import Console

from haptic_teleop_control.command_line import ArgumentParser, positive, run_command
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_sim.export import Exported, mjcf_export, python_export, urdf_export
from haptic_teleop_sim.model import Model, load_model
from haptic_teleop_sim.mujoco_robot import TIMESTEP
from haptic_teleop_sysid.commands.export_cost import costs, simulated_there
from haptic_teleop_sysid.commands.export_reference import multisine, recorded
from haptic_teleop_sysid.commands.treatment_options import add_mapping_option
from haptic_teleop_sysid.logs.story import tell
from haptic_teleop_sysid.report.output import refuse_inputs
from haptic_teleop_sysid.report.terminal import say
from haptic_teleop_sysid.report.terminal_table import TerminalTable
from haptic_teleop_sysid.results import tool_version, write_json

TARGETS = ("mujoco", "urdf", "python")


def exported(model: Model, target: str, timestep: float = TIMESTEP) -> Exported:
    """Return the model as text for `target`, one of TARGETS; `timestep` in s is MuJoCo's."""
    if target == "mujoco":
        return mjcf_export(model, timestep)
    return urdf_export(model) if target == "urdf" else python_export(model)


def run(argv: list[str]) -> int:
    """Do what the arguments say; returns the exit status."""
    arguments = _parser().parse_args(argv)
    model = load_model(arguments.model)
    read = [one for one in (arguments.model, arguments.bag, arguments.mapping) if one]
    output = _claim(Path(arguments.output), read, arguments.overwrite)
    file = exported(model, arguments.to, arguments.timestep)
    progress = Console(stderr=True)
    with progress.status("simulating with and without"):
        if arguments.bag is None:
            reference = multisine(model, arguments.rms, arguments.seconds)
        else:
            reference = recorded(model, arguments.bag, arguments.allow_gaps, arguments.mapping)
            tell(progress, {arguments.bag: reference.dataset.experiment}, arguments.verbose)
        content: dict[str, Any] = {
            "schema": 1,
            "model": arguments.model,
            "target": arguments.to,
            "file": output.name,
            "robot": model.robot,
            "joint": model.joint,
            "measured_on": reference.described(),
            **costs(model, file, reference),
            "there": simulated_there(model, file, arguments.to, reference),
            "version": tool_version(),
        }
    partial = output.with_name(output.name + ".partial")
    partial.write_text(file.text, encoding="utf-8")
    partial.replace(output)
    beside = write_json(_beside(output), content)
    _show(Console(), content, output, beside)
    return 0


def main(argv: list[str] | None = None) -> int:
    """Entry point: exit status 0 when the file was written, 2 for bad arguments or files."""
    return run_command(run, argv)


def _beside(output: Path) -> Path:
    return output.with_name(output.name + ".json")


def _claim(output: Path, read: list[str], overwrite: bool) -> Path:
    if output.is_dir():
        raise ConfigurationError(f"--output {output} is a directory: name a file in it.")
    for path in (output, _beside(output)):
        refuse_inputs(path, read)
        if path.exists() and not overwrite:
            raise ConfigurationError(f"{path} exists: choose another --output, or say --overwrite.")
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        probe = output.with_name(output.name + ".partial")
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise ConfigurationError(
            f"--output {output} cannot be written ({error.strerror}): choose another --output."
        ) from error
    return output


def _show(console: Console, content: dict[str, Any], output: Path, beside: Path) -> None:
    rows = [(f"{r['effect']} at {r['location']}", r) for r in content["effects"] if r["how"] != "expressed"]
    if content["structure"] is not None:
        rows.insert(0, ("flexible joint", content["structure"]))
    if rows:
        cells = [(name, row["how"], _cost(row), row["note"]) for name, row in rows]
        console.print(TerminalTable(("physics", "in the file", "cost, points of fit", "how"), cells))
    on = content["measured_on"]
    told = f"{on['bag']}" if on["kind"] == "recording" else (
        f"a multisine of {on['rms']:g} {on['unit']} rms, {on['f_min_hz']:g} to {on['f_max_hz']:g} Hz, "
        f"{on['samples'] * on['dt_s']:g} s, seed {on['seed']}")  # fmt: skip
    lines = ["everything in the model is in the file"]
    if rows:
        (_, fit), (signal, less) = _lowest(content["fit"]["model"]), _lowest(content["fit"]["as_exported"])
        lines = [
            f"costs are measured on {told}, simulated here with and without, each alone at its worst signal",
            f"all together: lowest fit {less:.2f} % ({signal}), {fit:.2f} % with the whole model",
        ]
    there = content["there"]
    if "why_not" in there:
        lines.append(f"not simulated where it is to go: {there['why_not']}")
    else:
        meant, whole = (_lowest(there[k]["fit"])[1] for k in ("as_exported", "model"))
        lines.append(
            f"{there['engine']} simulates the file over {there['seconds']:g} s: lowest fit {meant:.2f} % to "
            f"what the file is meant to say, {whole:.2f} % to the whole model"
        )
    lines.append(f"written: {output}, {beside.name}")
    for line in lines:
        say(console, line)


def _cost(row: dict[str, Any]) -> str:
    if row["cost"] is None:
        return f"not measured: {row['why_no_cost']}"
    signal, less = _lowest({name: -points for name, points in row["cost"].items()})
    return f"{-less:.2f} ({signal})"


def _lowest(fits: dict[str, float]) -> tuple[str, float]:
    """The worst signal and its number; one that is no number (the signal stands still) only where all are."""
    return min(fits.items(), key=lambda item: math.inf if math.isnan(item[1]) else item[1])


def _duration(text: str) -> float:
    value = positive(text)
    if not 1.0 <= value <= 600.0:
        raise argparse.ArgumentTypeError(f"{text!r} is not between 1 and 600 s")
    return value


def _timestep(text: str) -> float:
    value = positive(text)
    if not 1e-6 <= value <= 0.01:
        raise argparse.ArgumentTypeError(f"{text!r} is not between 1e-6 and 0.01 s")
    return value


def _parser() -> argparse.ArgumentParser:
    parser = ArgumentParser(prog="haptic-teleop export", description=__doc__)
    parser.add_argument("--model", required=True, metavar="MODEL.yaml", help="the model to export")
    parser.add_argument("--to", required=True, choices=TARGETS, help="what it is exported for")
    parser.add_argument(
        "--output", required=True, metavar="FILE",
        help="the file to write; FILE.json beside it says what it lacks and what that costs",
    )  # fmt: skip
    parser.add_argument(
        "--bag", metavar="BAG", help="measure on this recording or log (default: a simulated multisine)"
    )
    parser.add_argument(
        "--rms", type=positive, help="root mean square of the multisine, in the model's input"
    )
    parser.add_argument("--seconds", type=_duration, default=20.0, help="length of the multisine (20)")
    parser.add_argument(
        "--timestep", type=_timestep, default=TIMESTEP, metavar="S",
        help=f"time step in the MJCF file (default: {TIMESTEP:g})",
    )  # fmt: skip
    parser.add_argument(
        "--allow-gaps", action="store_true", help="leave holes in the recording out instead of refusing it"
    )
    parser.add_argument("--overwrite", action="store_true", help="replace FILE and FILE.json")
    add_mapping_option(parser)
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
