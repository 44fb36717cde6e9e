"""Run the benchmarks of this folder one after another, each in a process of its own.

    python tests/benchmarks/run.py [NAME ...]

A benchmark is a script beside this file. It prints its figures, each with what it is compared with, and exits
with a status other than 0 when a promise is not kept. One at a time and in a fresh process, so that none is
measured in another's wake.
"""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent


def benchmarks() -> dict[str, Path]:
    """The scripts by name, in alphabetical order; names that start with an underscore are helpers."""
    own = Path(__file__).name
    return {p.stem: p for p in sorted(HERE.glob("*.py")) if p.name != own and not p.name.startswith("_")}


def run(script: Path) -> int:
    """Its exit status. Whoever ends this program ends the benchmark, which may have something to put away."""
    with subprocess.Popen([sys.executable, str(script)]) as benchmark:
        try:
            return benchmark.wait()
        except SystemExit:
            benchmark.terminate()
            raise


def main(names: list[str]) -> int:
    """Run the named benchmarks, or all: 0 if each kept its promise, 1 if not, 2 for a wrong name."""
    known = benchmarks()
    if unknown := [name for name in names if name not in known]:
        print(f"error: no benchmark {', '.join(unknown)}: there are {', '.join(known)}", file=sys.stderr)
        return 2
    os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)
    processor = next((line.split(":")[1].strip() for line in Path("/proc/cpuinfo").read_text().splitlines()
                      if line.startswith("model name")), "unknown processor")
    print(f"{len(os.sched_getaffinity(0))} cores, {processor}, load {os.getloadavg()[0]:.1f}", flush=True)
    failed = []
    for name in names or known:
        print(f"\n== {name}", flush=True)
        start = time.monotonic()
        if run(known[name]):
            failed.append(name)
        print(f"   ({time.monotonic() - start:.1f} s)", flush=True)
    if failed:
        print(f"\npromise not kept: {', '.join(failed)}")
    return 1 if failed else 0


if __name__ == "__main__":
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda received, _: sys.exit(128 + received))
    sys.exit(main(sys.argv[1:]))
