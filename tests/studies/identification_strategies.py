"""Which strategy arrives from how far, and what it takes: the table in identification_measured.md.

    python tests/studies/identification_strategies.py [SEEDS]

Every free parameter starts too high or too low by the factor; arrived: all within 10 % of the truth (the
friction's shape, velocity and smoothing, within 30 %), on one recording of 24 s with encoder steps and a
disturbance of 1 % rms.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

from haptic_teleop_sysid.estimation.strategies import estimate
from haptic_teleop_sysid.recordings.dataset import load_dataset

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "unit"))
from identification_plants import AXIS, STAGE, axis_recording, stage_recording

PLANTS = {
    "stage 1, open loop": (STAGE, lambda seed: stage_recording(seed=seed)),
    "omni_y, closed loop": (AXIS, lambda seed: axis_recording(seed=seed, rms=0.1)),
}
STRATEGIES = {
    "prediction error": {"method": "prediction-error"},
    "prediction error, 6 starts": {"method": "prediction-error", "multi_start": 6},
    "output error": {"method": "output-error"},
    "progressive (thesis)": {"method": "progressive"},
}
FACTORS = (1.3, 2.0, 4.0)
SHAPES = ("velocity", "smoothing")


def main(seeds: int) -> None:
    print("| plant | strategy | starts off by | arrived | said it had not | median error | CPU s |")
    print("|---|---|---|---|---|---|---|")
    for plant, (truth, make) in PLANTS.items():
        names, true = truth.free_parameters(), truth.parameter_values()
        data = [load_dataset(make(seed), truth) for seed in range(1, seeds + 1)]
        near = np.array([0.3 if n.split(".")[-1] in SHAPES else 0.1 for n in names])
        for strategy, options in STRATEGIES.items():
            for factor in FACTORS:
                arrived, told, apart, seconds = 0, 0, [], []
                for seed, one in enumerate(data, start=1):
                    signs = np.random.default_rng(2000 + seed).choice([-1.0, 1.0], len(names))
                    start = truth.with_values(
                        {n: true[n] * factor**s for n, s in zip(names, signs, strict=True)}
                    )
                    begun = time.process_time()
                    found = estimate(start, [one], **options)
                    seconds.append(time.process_time() - begun)
                    values = found.model.parameter_values()
                    error = np.abs([values[n] / true[n] - 1.0 for n in names])
                    reached = bool(np.all(error < near))
                    arrived += reached
                    told += not reached and (not found.converged or found.misled is not None)
                    apart.append(np.median(error))
                print(
                    f"| {plant} | {strategy} | {factor:g} | {arrived} of {seeds} "
                    f"| {told} of {seeds - arrived} "
                    f"| {100 * np.median(apart):.2g} % | {np.median(seconds):.1f} |",
                    flush=True,
                )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 8)
