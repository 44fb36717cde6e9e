"""Does anything in a simulated experiment depend on when its processes run? Stops them and compares.

    python tests/studies/stopped_processes.py --seeds 20  # single processes stopped for 0.07 to 1.5 s
    python tests/studies/stopped_processes.py --seeds 20 --freeze 0.3  # all together, three times each
    python tests/studies/stopped_processes.py --seeds 20 --freeze 0.3 --demo  # the demonstration

Every seed runs the scenario as processes (`--composed`: in one) with a recording, beside `--hogs` processes
that burn the processor, and stops one process after another with SIGSTOP. The recording then has to hold the
stamps and values of the lockstep runner, bit for bit, and no fault; of the demonstration the report has to
be green. Prints a line per seed; exit status 1 where one fails.
"""

from __future__ import annotations

import argparse
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from haptic_teleop_sim.lockstep import run_scenario

sys.path.insert(0, str(Path(__file__).parents[1] / "end_to_end"))
from graph_runs import CONFIG, FRONT_DOOR, differences, scenario_command, stop_now_and_then

HOG = [sys.executable, "-c", "while True: pass"]


def one_seed(seed: int, arguments: argparse.Namespace, expected: dict) -> tuple[bool, str]:
    luck = random.Random(seed)
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder, "demo", "recording") if arguments.demo else Path(folder, "bag")
        options = ["--duration", f"{arguments.duration:g}", "--real-time-factor", f"{arguments.factor:g}"]
        options += [] if arguments.composed else ["--processes"]
        command = scenario_command(arguments.scenario, bag, *options)
        if arguments.demo:
            duration = f"{arguments.duration:g}"
            command = [*FRONT_DOOR, "demo", "--duration", duration, "--output", str(bag.parent)]
        hogs = [subprocess.Popen(HOG) for _ in range(arguments.hogs)]
        began = time.monotonic()
        try:
            pipes = {"stderr": subprocess.PIPE, "stdout": subprocess.DEVNULL}
            with subprocess.Popen(command, text=True, **pipes) as run:
                stops = stop_now_and_then(
                    run, luck, arguments.freeze, arguments.begin, 18.0 if arguments.demo else 6.0
                )
                assert run.stderr is not None
                said = run.stderr.read()
        finally:
            for hog in hogs:
                hog.kill()
        wrong = differences(bag, expected) if bag.is_dir() else ["no recording"]
        if run.returncode:
            wrong.insert(0, f"exit status {run.returncode}: {said.strip().splitlines()[-1:]}")
        took = time.monotonic() - began
    return not wrong, f"seed {seed}: {stops} stops, {took:.0f} s: {'; '.join(wrong) or 'the same'}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--scenario", default=str(CONFIG / "scenario1_sim.yaml"))
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=1, help="the first seed")
    parser.add_argument("--duration", type=float, default=6.0, help="simulated seconds")
    parser.add_argument("--factor", type=float, default=0.0, help="real-time factor")
    parser.add_argument("--hogs", type=int, default=4)
    parser.add_argument("--freeze", type=float, default=0.0, help="s for which all are stopped, three times")
    parser.add_argument("--begin", type=float, default=4.0, help="s after the start of the first stop")
    parser.add_argument("--composed", action="store_true")
    parser.add_argument("--demo", action="store_true", help="the demonstration, in its own time")
    arguments = parser.parse_args()
    expected = run_scenario(arguments.scenario, arguments.duration)
    expected = getattr(expected, "topics", expected)
    failed = 0
    for seed in range(arguments.first, arguments.first + arguments.seeds):
        good, line = one_seed(seed, arguments, expected)
        failed += not good
        print(line, flush=True)
    print(f"{arguments.seeds - failed} of {arguments.seeds} the same")
    return 1 if failed else 0


if __name__ == "__main__":
    raise SystemExit(main())
