"""`haptic-teleop verify`: check recordings of a scenario against what the force law promises, lay a
simulation of the same scenario over them, and write a report.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from haptic_teleop_control.command_line import ArgumentParser, positive, run_command
from haptic_teleop_control.errors import ConfigurationError, MismatchError
from haptic_teleop_control.recording import read_recording
from haptic_teleop_control.robots import STAGES
from haptic_teleop_sysid.report import Status, claim_output_directory, save_png
from haptic_teleop_sysid.report.terminal import print_conclusion, say
from haptic_teleop_sysid.results import tool_version, write_json
from haptic_teleop_sysid.verification.conclusion import conclusion
from haptic_teleop_sysid.verification.overlay_report import overlay_all
from haptic_teleop_sysid.verification.page import key_figures, verification_page
from haptic_teleop_sysid.verification.pictures import stage_picture
from haptic_teleop_sysid.verification.run import Run, agreement, examine
from haptic_teleop_sysid.verification.simulation import TRUST_OPTION
from haptic_teleop_sysid.verification.verdicts import failures, verdicts

OVERRIDES = {
    "lambda": "λ of the force law, N·m·s/rad",
    "torque_gain": "desired torque per angle of the master, N·m/rad",
    "wall": "angle of the wall, rad",
    "stiffness": "stiffness of the joint, N·m/rad",
    "torque_constant": "nominal N·m/A of the recorded efforts",
}
RESULT = "verify.json"
FAILED = 1
STATUSES = """exit status:
  0  the report is written and begins with "ok" or "note"
  1  the report is written and begins with "bad": a fault, a run that was cut off, a damaged recording, a
     stage that oscillates, a promise that was not kept
  2  bad arguments, or a file that cannot be used: there is no report"""


@dataclass(frozen=True)
class Verification:
    """What a verification found. status, happened, todo: its conclusion. not_simulated: by a run's name, why
    no simulation was laid over it, as the end of a sentence about it."""

    runs: list[Run]
    not_simulated: dict[str, str]
    status: Status
    happened: str
    todo: str

    @property
    def failed(self) -> bool:
        """Whether its conclusion is that something is bad."""
        return self.status == "bad"


def verify(
    bags: list[str],
    output: Path,
    remove_delay: bool = False,
    overrides: dict[str, dict[str, float]] | None = None,
    simulate: bool = True,
    scenario: str | None = None,
    trust_code: bool = False,
) -> Verification:
    """Examine `bags`, simulate what they recorded, write verify.json, report.html and pictures into the
    directory `output`; return what was found.

    simulate: whether a simulation is laid over each recording that says enough about itself. scenario: a
    scenario file whose plants are simulated instead of those that the recordings name; then all of them must
    say enough. trust_code: whether a force law of somebody's own is imported, and so executed, because a
    recording names it.
    Raises RecordingError and MismatchError, naming the bag, for what cannot be read or is no recording of a
    scenario, ConfigurationError or ModelError for a scenario or model file that cannot be used.
    """
    began = time.perf_counter()
    recordings = [read_recording(bag) for bag in bags]
    runs = [examine(recording, bag, overrides) for recording, bag in zip(recordings, bags, strict=True)]
    if len({one.scenario for one in runs}) > 1:
        raise MismatchError(f"{', '.join(bags)} are not all of one scenario: verify them in two reports.")
    labels = short_names(bags)
    named = dict(zip(labels, recordings, strict=True))
    overlays = overlay_all(named if simulate else {}, scenario, remove_delay, trust_code)
    agreements = {label: agreement(runs[0], run) for run, label in zip(runs[1:], labels[1:], strict=True)}
    stages = dict.fromkeys(stage for one in runs for stage in one.stages)
    pictures = {stage: stage_picture(runs, stage, labels, remove_delay) for stage in stages}
    for stage, picture in pictures.items():
        save_png(picture, output / f"{stage}.png")
    for number, figures in enumerate(overlays.pictures.values(), start=1):
        for group, picture in figures.items():
            which = f"_{number}" if len(bags) > 1 else ""
            save_png(picture, output / f"simulation{which}_{group.replace(' ', '')}.png")
    verification_page(runs, labels, agreements, pictures, overlays).write(output / "report.html")
    not_simulated = {
        bag: overlays.reasons[label]
        for bag, label in zip(bags, labels, strict=True)
        if label in overlays.reasons
    }
    found = Verification(runs, not_simulated, *conclusion(runs, labels, list(overlays.reasons)))
    content: dict[str, Any] = {
        "schema": 1,
        "scenario": runs[0].scenario,
        "failed": found.failed,
        "conclusion": {"status": found.status, "happened": found.happened, "todo": found.todo},
        "runs": {run.name: run.as_json() | {"verdicts": verdicts(run)} for run in runs},
        "agreement": {bag: agreements[label] for bag, label in zip(bags[1:], labels[1:], strict=True)},
        "simulation": {
            bag: overlays.done[label].as_json()
            for bag, label in zip(bags, labels, strict=True)
            if label in overlays.done
        },
        "not_simulated": not_simulated,
        "delay_removed": remove_delay,
        "runtime_s": time.perf_counter() - began,
        "version": tool_version(),
    }
    write_json(output / RESULT, content)
    return found


def short_names(bags: list[str]) -> list[str]:
    """Return the shortest endings of the paths that tell them apart."""
    parts = [[part for part in bag.split("/") if part] or [bag] for bag in bags]
    for count in range(1, max(map(len, parts)) + 1):
        names = ["/".join(part[-count:]) for part in parts]
        if len(set(names)) == len(names):
            return names
    return bags


def run(argv: list[str]) -> int:
    """Do what the arguments say; returns the exit status."""
    arguments = _parser().parse_args(argv)
    for bag in arguments.bag:
        if arguments.bag.count(bag) > 1:
            raise ConfigurationError(f"{bag} is named twice: give each recording once.")
    overrides: dict[str, dict[str, float]] = {stage: {} for stage in STAGES}
    for name in OVERRIDES:
        values = getattr(arguments, name)
        if values is not None:
            for stage, value in zip(
                STAGES, values * len(STAGES) if len(values) == 1 else values, strict=False
            ):
                overrides[stage][name] = value
    output = claim_output_directory(arguments.output, RESULT, arguments.overwrite)
    with Console(stderr=True).status("verifying"):
        found = verify(
            arguments.bag,
            output,
            arguments.remove_delay,
            overrides,
            simulate=not arguments.no_simulation,
            scenario=arguments.simulate,
            trust_code=arguments.trust_recorded_code,
        )
    print_summary(found, output / "report.html")
    return FAILED if found.failed else 0


def print_summary(found: Verification, report: Path, figures_only: bool = False) -> None:
    """Print the conclusion, each run's verdicts (or its failures and key figures only), why one was not
    simulated, and where the report lies."""
    console = Console(highlight=False)
    words = {
        "good": "[green]ok[/green]  ",
        "fair": "[yellow]note[/yellow]",
        "bad": "[red]bad[/red] ",
        "plain": "    ",
    }
    print_conclusion(console, found.status, found.happened, found.todo)
    for one in found.runs:
        say(console, one.name)
        if figures_only:
            for status, text in failures(one):
                console.print(f"  {words[status]} ", end="")
                say(console, text)
            for value, label, note in key_figures(one):
                say(console, f"  {label:28} {value:>14}   {note}")
            continue
        for status, text in verdicts(one):
            console.print(f"  {words[status]} ", end="")
            say(console, text)
        if one.name in found.not_simulated:
            say(console, f"       no simulation: it {found.not_simulated[one.name]}.")
    say(console, f"report: {report}")


def main(argv: list[str] | None = None) -> int:
    """Entry point: exit status 0 when a report was written, 1 when it begins with something bad, 2 for bad
    arguments or files."""
    return run_command(run, argv)


def _parser() -> argparse.ArgumentParser:
    parser = ArgumentParser(
        prog="haptic-teleop verify",
        description=__doc__,
        epilog=STATUSES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "bag", nargs="+", metavar="BAG", help="recordings of one scenario, laid over each other"
    )
    parser.add_argument(
        "--output", required=True, metavar="DIR", help=f"where {RESULT}, report.html and pictures go"
    )
    parser.add_argument(
        "--remove-delay", action="store_true", help="count each run's time from the onset of its command"
    )
    simulation = parser.add_mutually_exclusive_group()
    simulation.add_argument(
        "--simulate",
        metavar="FILE",
        help="scenario file whose plants are simulated beside the recordings; needed where these were made "
        "with drivers (default: the simulated plants that a recording names)",
    )
    simulation.add_argument(
        "--no-simulation", action="store_true", help="no simulation beside the recordings"
    )
    parser.add_argument(
        TRUST_OPTION,
        action="store_true",
        help="import a force law that does not come with this project (law: module:Law) because a recording "
        "names it: this EXECUTES that module's code, from what is installed or from the working directory. "
        "Only for recordings and code that you trust; without it such a recording is not simulated",
    )
    parser.add_argument(
        "--overwrite", action="store_true", help="replace the results of an earlier run in DIR"
    )
    group = parser.add_argument_group(
        "settings", "instead of what the recordings say: one value, or one for each stage"
    )
    for name, meaning in OVERRIDES.items():
        option = "--" + name.replace("_", "-")
        group.add_argument(option, nargs="+", type=positive, action=_OnePerStage, metavar="X", help=meaning)
    return parser


class _OnePerStage(argparse.Action):
    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option: str | None = None,
    ) -> None:
        if len(values) > len(STAGES):
            parser.error(
                f"{option} takes one value, or one for each of {', '.join(STAGES)}; got {len(values)}"
            )
        setattr(namespace, self.dest, values)


if __name__ == "__main__":
    raise SystemExit(main())
