"""`haptic-teleop preview FILE`: the commands of a scenario or an acquisition as a picture, before anything
moves."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from haptic_teleop_control.acquisition import TABLE, Acquisition
from haptic_teleop_control.command_line import ArgumentParser, run_command
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.node_tables import SIGNAL_GENERATOR, without_node_parameters
from haptic_teleop_control.parameter_files import load_parameter_file, parameters_for
from haptic_teleop_control.signals import SignalGenerator
from haptic_teleop_control.signals.preview import draw, times_to_draw
from haptic_teleop_control.signals.settings import SignalSettings

SECTIONS = ("signal_generator", "acquisition")


class Command(Protocol):
    """What commands a robot: `series` gives commands (time, stages) at times (time,), s; `end` in s."""

    @property
    def settings(self) -> Mapping[str, SignalSettings]: ...
    @property
    def rate(self) -> float: ...
    @property
    def end(self) -> float: ...
    @property
    def unit(self) -> str: ...
    def series(self, t: ArrayLike, /) -> NDArray[np.float64]: ...


class AcquisitionCommand:
    """The signal of an identification experiment, as a Command."""

    def __init__(self, experiment: Acquisition) -> None:
        self._experiment = experiment
        self.settings = {experiment.joint: experiment.settings}
        self.rate: float = experiment.values["rate"]
        self.end, self.unit = experiment.end, experiment.unit

    def series(self, t: ArrayLike, /) -> NDArray[np.float64]:
        """Commands (time, 1) at times (time,), s."""
        return self._experiment.series(t)[:, np.newaxis]


def command_of(path: str | Path) -> tuple[Command, list[str]]:
    """What the file commands, and the warnings that the experiment would begin with.

    Raises ConfigurationError for a file without signal, with two, or with one that its node would refuse.
    """
    sections = load_parameter_file(path)
    found = [name for name in SECTIONS if _stated(sections, name)]
    if len(found) != 1:
        has = "both a section signal_generator and a section acquisition" if found else "no signal"
        raise ConfigurationError(
            f"{path} has {has}: give a scenario file with a section `signal_generator:`, or an acquisition "
            "file with a section `acquisition:`."
        )
    if found == ["acquisition"]:
        own = without_node_parameters(parameters_for(sections, "acquisition", TABLE))
        experiment = Acquisition.from_parameters(own, str(path))
        return AcquisitionCommand(experiment), list(experiment.warnings)
    own = SIGNAL_GENERATOR.check(parameters_for(sections, "signal_generator", SIGNAL_GENERATOR), str(path))
    signal = {key: value for key, value in own.items() if key not in ("joints", "autostart")}
    return SignalGenerator.from_parameters(without_node_parameters(signal), source=str(path)), []


def in_words(command: Command, times: NDArray[np.float64], values: NDArray[np.float64]) -> list[str]:
    """A line for each stage or axis: when it is commanded, and from where to where."""
    lines = []
    for (name, own), column in zip(command.settings.items(), values.T, strict=True):
        if not own.enabled:
            lines.append(f"{name}: not enabled, stays at 0")
            continue
        end = own.delay + own.duration
        until = "without end" if math.isinf(end) else f"to {end:g} s"
        shown = "" if end <= times[-1] else f" (looked at up to {times[-1]:g} s)"
        lines.append(
            f"{name}: {column.min():.4g} to {column.max():.4g} {command.unit}, "
            f"from {own.delay:g} s {until}{shown}"
        )
    return lines


def main(argv: Sequence[str] | None = None) -> int:
    """The command `preview`: exit status 0, or 2 for a file that the nodes would refuse."""
    return run_command(_main, argv)


def _main(argv: list[str]) -> int:
    parser = ArgumentParser(
        prog="haptic-teleop preview",
        description="Draw what a scenario or an acquisition commands, and say its range. Nothing moves.",
    )
    parser.add_argument("file", type=Path, metavar="FILE", help="such as config/scenario1_sim.yaml")
    parser.add_argument(
        "--output", type=Path, metavar="PICTURE", help=".png or .svg (default: FILE's name with .png, here)"
    )
    parser.add_argument(
        "--span",
        type=float,
        metavar="S",
        help="time to draw (default: the scenario's duration, else to the end, 100 s at most)",
    )
    options = parser.parse_args(argv)
    command, warnings = command_of(options.file)
    span = options.span
    if span is None:
        span = parameters_for(load_parameter_file(options.file), "scenario").get("duration") or None
        span = span or _to_the_last_step(command)
    times = times_to_draw(command.end, command.rate, span)
    values = command.series(times)
    picture = options.output or Path(f"{options.file.stem}.png")
    draw(picture, times, values, command.settings, f"command / {command.unit}")
    for line in (*in_words(command, times, values), *warnings, f"picture: {picture}"):
        print(line)
    return 0


def _to_the_last_step(command: Command) -> float | None:
    """s, a little beyond the last step, where steps without end are all that is commanded; else None."""
    enabled = [own for own in command.settings.values() if own.enabled]
    if not enabled or not all(own.steps.enabled and math.isinf(own.duration) for own in enabled):
        return None
    return 1.2 * max(own.delay + own.steps.times[-1] for own in enabled)


def _stated(sections: Mapping[str, Mapping[str, Any]], node: str) -> bool:
    return any(name.rstrip("/").rsplit("/", 1)[-1] == node for name in sections)
