"""`diagnose --bags` on a local Dask cluster of two workers, killed in the middle and started again: for
docs/many_recordings.md.

    python tests/studies/killed_and_resumed.py FOLDER [--recordings N] [--seconds S]

The recordings are of a simulated 2DSFJ stage with dry friction, which the given model does not have; one of
them is cut short. FOLDER must be new.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from distributed import LocalCluster

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "unit"))
from identification_plants import STAGE
from weekly_recordings import write_week

COMMAND = "from haptic_teleop_control.front_door import main; raise SystemExit(main())"
#: Outcomes behind which the run is killed, and s for which they are awaited.
ENDED, PATIENCE = 2, 1800.0


def outcomes(output: Path) -> dict[str, int]:
    """What has ended so far, with the times at which it was written."""
    return {str(p.relative_to(output)): p.stat().st_mtime_ns for p in output.rglob("outcome.json")}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--recordings", type=int, default=6)
    parser.add_argument("--seconds", type=float, default=9.0)
    arguments = parser.parse_args()
    folder: Path = arguments.folder.resolve()
    bags, output, model = folder / "bags", folder / "out", folder / "model.yaml"
    bags.mkdir(parents=True)
    for week in range(1, arguments.recordings + 1):
        write_week(bags, week, seconds=arguments.seconds)
    (bags / "broken.mcap").write_bytes(b"\x89MCAP0\r\n and nothing more")
    STAGE.save(model)
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0") as cluster:
        run = [sys.executable, "-c", COMMAND, "diagnose", "--model", str(model), "--bags", str(bags)]
        run += ["--output", str(output), "--no-report", "--dask", cluster.scheduler_address]
        began = time.monotonic()
        first = subprocess.Popen(run)
        # One more: that of the broken one.
        while len(outcomes(output)) < ENDED + 1 and time.monotonic() < began + PATIENCE:
            if first.poll() is not None:
                raise SystemExit("it ended before it could be killed: give more recordings")
            time.sleep(0.05)
        os.kill(first.pid, signal.SIGKILL)
        first.wait()
        kept, killed = outcomes(output), time.monotonic() - began
        began = time.monotonic()
        second = subprocess.run(run, check=False, capture_output=True, text=True)
        took = time.monotonic() - began
    print(second.stdout, second.stderr, sep="\n")
    after = outcomes(output)
    same = [name for name, when in kept.items() if after.get(name) == when]
    content = json.loads((output / "overview.json").read_text())
    verdicts = [f"{r['name']}: {r['verdict']}: {r['what']}" for r in content["ranking"]]
    print(f"killed after {killed:.0f} s with {len(kept)} outcomes; {len(same)} of them were kept")
    print(f"resumed for {took:.0f} s, exit status {second.returncode}: {len(after)} outcomes")
    print(*verdicts, sep="\n")
    whole = len(verdicts) == arguments.recordings and len(content["unusable"]) == 1
    return 0 if second.returncode == 0 and whole and len(same) == len(kept) else 1


if __name__ == "__main__":
    raise SystemExit(main())
