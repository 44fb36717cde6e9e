"""What threads gain: independent fits and a whole diagnosis on one thread and on all cores, against what
independent runs of the bare kernel gain there.

Wall-clock times, alternating, the best of several: cores that share memory, heat or a host reach less than
their number, so the kernel says what there is to be had.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np

from haptic_teleop_sim.kernel import pack, predict
from haptic_teleop_sysid.diagnosis.run import diagnose
from haptic_teleop_sysid.diagnosis.usable import records_of
from haptic_teleop_sysid.estimation.parallel import VARIABLE, side_by_side, thread_count
from haptic_teleop_sysid.estimation.tuning import initial_noise
from haptic_teleop_sysid.estimation.whole_fit import fit_whole
from haptic_teleop_sysid.recordings.dataset import load_dataset

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "unit"))
from diagnosis import HIDDEN, LAB, STAGE, recorded

ROUNDS, LEAST = 5, 0.9
"""Repetitions; least share of the kernel's gain that fits reach."""


def wall(work) -> float:
    """Time of one call, s."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def gain(one, all_) -> float:
    """Ratio of the least times of two ways, tried in turn."""
    times = [(wall(one), wall(all_)) for _ in range(ROUNDS)]
    return min(a for a, _ in times) / min(b for _, b in times)


def main() -> int:
    """Print the table; 1 when fits on all cores gain less than LEAST of what the kernel does."""
    cores = thread_count()
    truth = replace(STAGE, effects=(HIDDEN,))
    sets = [load_dataset(recorded(truth, 20.0, seed), LAB, f"seed {seed}") for seed in (1, 2)]
    records = records_of([sets[0]])
    start = LAB.with_effects(HIDDEN)
    noise, packed, free = initial_noise(pack(LAB), records), pack(start), start.free_parameters()

    def kernels(_=None):
        for _ in range(8):
            predict(packed, records[0].input, records[0].measured, records[0].dt, free)

    def fits(threads):
        os.environ[VARIABLE] = str(threads)
        side_by_side(lambda n: fit_whole(start, n, records, iterations=4), [noise] * (2 * cores))

    def several():
        with ThreadPoolExecutor(cores) as pool:
            list(pool.map(kernels, range(cores)))

    def one_by_one():
        for _ in range(cores):
            kernels()

    kernels(), fits(1)
    bare = gain(one_by_one, several)
    found = gain(lambda: fits(1), lambda: fits(cores))
    print(f"{cores} cores: the bare kernel {bare:.2f} times as fast as on one, "
          f"independent fits {found:.2f} times, {100.0 * found / bare:.0f} % of that")  # fmt: skip

    def diagnosed(threads):
        os.environ[VARIABLE] = str(threads)
        diagnose(LAB, [sets[0]], [sets[1]])

    diagnosed(1)
    times = [(wall(lambda: diagnosed(1)), wall(lambda: diagnosed(cores))) for _ in range(2)]
    alone, together = (float(np.min(column)) for column in zip(*times, strict=True))
    print(f"diagnosis of two recordings of 20 s: {alone:.1f} s on one thread, {together:.1f} s on {cores}, "
          f"{alone / together:.2f} times as fast")  # fmt: skip
    kept = cores == 1 or found >= LEAST * bare
    print(f"   {'kept' if kept else 'NOT KEPT'}: independent fits reach {LEAST:g} of what the kernel does")
    return 0 if kept else 1


if __name__ == "__main__":
    sys.exit(main())
