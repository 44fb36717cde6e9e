"""`haptic-teleop demo`: scenario 1 in simulation as real ROS 2 nodes, recorded, verified, with a report."""

from __future__ import annotations

import argparse
import signal
import subprocess
import sys
from pathlib import Path

from haptic_teleop_control.command_line import INTERRUPTED, ArgumentParser, run_command
from haptic_teleop_control.errors import HapticTeleopError
from haptic_teleop_control.parent_death import ends_with_parent
from haptic_teleop_sysid.commands.verify import print_summary, verify
from haptic_teleop_sysid.report import numbered_output_directory
from haptic_teleop_sysid.shipped_files import SCENARIO, find_scenario
from haptic_teleop_sysid.verification.run import Run
from haptic_teleop_sysid.verification.signals import COMMAND_TOPIC, STATE_TOPIC

STOPPING_SECONDS = 20.0
"""How long the scenario is given to stop its nodes and close the recording after Ctrl-C."""
COVERED_SHARE = 0.9
ANSWERED_SHARE = 0.9


def run_scenario(
    scenario: Path, recording: Path, duration: float, factor: float | None = None, after_fault: float = 0.0
) -> int:
    """Run the scenario as a process of its own, its progress on our standard error; return its exit status.

    duration: s of the experiment. factor: the real-time factor, 0 for as fast as it goes; None: the file's.
    after_fault: s after the first fault at which it ends; 0: it goes on.
    A terminal's Ctrl-C reaches it too; it is then given time to stop the nodes and to close the recording.
    It does not outlive this process: whatever ends that, the nodes are stopped in order, robots at zero.
    """
    command = [
        *(sys.executable, "-P", "-m", "haptic_teleop_control.front_door", "scenario", str(scenario)),
        *("--duration", f"{duration:g}", "--record", str(recording)),
        *(("--end-after-fault", f"{after_fault:g}") if after_fault else ()),
        *(() if factor is None else ("--real-time-factor", f"{factor:g}")),
    ]
    with subprocess.Popen(command, preexec_fn=ends_with_parent()) as process:
        try:
            return process.wait()
        except BaseException:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(STOPPING_SECONDS)
            except subprocess.TimeoutExpired:
                process.kill()
            raise


def graph_failure(run: Run, duration: float) -> str | None:
    """Return a sentence when the recording shows that the graph did not hold to the end, else None."""
    states = run.graph["topics"].get(STATE_TOPIC)
    loops = [entry for entry in run.graph["latency"] if entry["command_topic"] == COMMAND_TOPIC]
    if states is None or not loops:
        return f"{COMMAND_TOPIC} never answered {STATE_TOPIC}"
    covered = states["messages"] * states["period"]
    if covered < COVERED_SHARE * duration:
        return f"the states on {STATE_TOPIC} cover {covered:.1f} s of {duration:g} s"
    # Of all states: a controller that died leaves those after its last command unanswered, too.
    share = loops[0]["answered"] / states["messages"]
    if share < ANSWERED_SHARE:
        return f"only {100 * share:.0f} % of the states were answered on {COMMAND_TOPIC}"
    return None


def run(argv: list[str]) -> int:
    """Do what the arguments say; returns the exit status."""
    arguments = _parser().parse_args(argv)
    scenario = Path(arguments.scenario) if arguments.scenario else find_scenario()
    output = numbered_output_directory(arguments.output)
    recording = output / "recording"
    print(f"scenario 1 in simulation for {arguments.duration:g} s: {scenario}", file=sys.stderr, flush=True)
    try:
        status = run_scenario(scenario, recording, arguments.duration, arguments.real_time_factor)
    except KeyboardInterrupt:
        print(f"stopped; what was recorded lies in {recording}", file=sys.stderr)
        return INTERRUPTED
    if not recording.is_dir():
        print(f"the scenario ended with exit status {status} and recorded nothing", file=sys.stderr)
        return status or 1
    try:
        # The scenario file names the code that has just run; the recording can only repeat it.
        found = verify([str(recording)], output, trust_code=True)
    except HapticTeleopError as error:
        # A run that broke down leaves little to verify; its own exit status tells more than the
        # verification's.
        if status:
            print(f"the scenario ended with exit status {status}; {error}", file=sys.stderr)
            return status
        raise
    print_summary(found, output / "report.html", figures_only=True)
    failure = graph_failure(found.runs[0], arguments.duration)
    if failure is not None:
        print(f"the run lost its graph: {failure}", file=sys.stderr)
    elif status:
        print(f"the scenario ended with exit status {status}", file=sys.stderr)
    elif found.failed:
        print("the run failed: see what is said first above", file=sys.stderr)
    return status or (1 if failure is not None or found.failed else 0)


def main(argv: list[str] | None = None) -> int:
    """Entry point: exit status 0 when the graph ran to the end without a fault and the report was written."""
    return run_command(run, argv)


def _parser() -> argparse.ArgumentParser:
    parser = ArgumentParser(prog="haptic-teleop demo", description=__doc__)
    parser.add_argument(
        "--duration", type=_seconds, default=20.0, metavar="S", help="simulated seconds (default: 20)"
    )
    parser.add_argument(
        "--real-time-factor", type=_factor, metavar="F",
        help="simulated seconds per second, at most; 0: as fast as it goes (default: as in the file)",
    )  # fmt: skip
    parser.add_argument(
        "--output", default="output/demo", metavar="DIR",
        help="where recording and report go (default: output/demo; numbered when it exists)",
    )  # fmt: skip
    parser.add_argument(
        "--scenario", metavar="FILE", help=f"scenario file (default: the project's {SCENARIO})"
    )
    return parser


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = 0.0
    if not 1.0 <= seconds <= 3600.0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of seconds from 1 to 3600")
    return seconds


def _factor(text: str) -> float:
    try:
        factor = float(text)
    except ValueError:
        factor = -1.0
    if not 0.0 <= factor <= 1000.0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number from 0 to 1000")
    return factor


if __name__ == "__main__":
    raise SystemExit(main())
