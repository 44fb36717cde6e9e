"""How far off the estimates are, and how often their 95 % intervals hold the truth: the table in
identification_measured.md.

    python tests/studies/identification_coverage.py [CASE ...] [--seeds N] [--seconds S] [--minutes M]

Encoders step, current is sensed with noise, a random torque of 1 % rms of the motor torque acts, starts are
30 % off. The recordings last S seconds. After the minutes of wall time no further seed is begun, and the
table says how many there were.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.estimation.strategies import estimate
from haptic_teleop_sysid.recordings.dataset import load_dataset

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "unit"))
from identification_plants import AXIS, STAGE, axis_recording, off, stage_recording

STICKING = STAGE.with_effects(Effect("coulomb_friction", "stage1_motor", {"torque": 0.4}))
CASES = {
    "stage-open": (STAGE, lambda seed, seconds: stage_recording(seed=seed, seconds=seconds)),
    "stage-closed": (STAGE, lambda seed, seconds: stage_recording(seed=seed, seconds=seconds, closed=True)),
    "axis": (AXIS, lambda seed, seconds: axis_recording(seed=seed, seconds=seconds, rms=0.1)),
    "axis-quick": (AXIS, lambda seed, seconds: axis_recording(seed=seed, seconds=seconds, rms=0.2)),
    "stage-stick": (
        STICKING,
        lambda seed, seconds: stage_recording(STICKING, seed=seed, seconds=seconds, rms=0.2, band=(0.1, 5.0)),
    ),
}


def study(case: str, seeds: int, seconds: float, minutes: float, doubt: bool) -> None:
    """Print the table of one case, failures included; every seed on standard error."""
    truth, make = CASES[case]
    names, true = truth.free_parameters(), truth.parameter_values()
    errors, scores, took, undetermined, unconverged, doubted, misled = [], [], [], 0, 0, 0, 0
    end = time.monotonic() + 60.0 * minutes
    for seed in range(1, seeds + 1):
        if time.monotonic() > end:
            seeds = seed - 1
            break
        start = off(truth, seed)
        data = load_dataset(make(seed, seconds), start)
        begun = time.process_time()
        fit = estimate(start, [data], cross_check=doubt)
        took.append(time.process_time() - begun)
        unsure = fit.uncertainty
        if unsure is None:
            raise RuntimeError(f"{case}, seed {seed}: {fit.message}")
        found = fit.model.parameter_values()
        undetermined += len(unsure.undetermined)
        unconverged += not fit.converged
        doubted += bool(fit.disagreement())
        misled += fit.misled is not None
        errors.append([found[n] / true[n] - 1.0 for n in names])
        scores.append([(found[n] - true[n]) / s for n, s in zip(names, unsure.std, strict=True)])
        worst = float(np.max(np.abs(scores[-1])))
        print(f"{case} {seed}: {took[-1]:.1f} s, worst {worst:.2f} standard errors", file=sys.stderr)
    error, score = np.abs(errors), np.array(scores)
    inside = np.abs(score) < 1.96
    print(
        f"\n{case}: {seeds} seeds of {seconds:g} s, {np.median(took):.1f} s each, {unconverged} not "
        f"converged, {undetermined} called undetermined, {misled} given up"
        + (f", {doubted} doubted when looking further ahead" if doubt else "")
    )
    print(
        "| parameter | median error | worst error | covered by 95 % | mean of error / std |\n"
        "|---|---|---|---|---|"
    )
    for i, name in enumerate(names):
        print(
            f"| {name} | {100 * np.median(error[:, i]):.4f} % | {100 * error[:, i].max():.4f} % | "
            f"{100 * inside[:, i].mean():.0f} % | {score[:, i].mean():+.2f} |"
        )
    print(
        f"| all | {100 * np.median(error):.4f} % | {100 * error.max():.4f} % | {100 * inside.mean():.1f} % "
        "| |",
        flush=True,
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", nargs="*", metavar="CASE", help=", ".join(CASES))
    parser.add_argument("--seeds", type=int, default=50)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--without-cross-check", action="store_true", help="takes half the time")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="for each case")
    arguments = parser.parse_args()
    if unknown := [name for name in arguments.cases if name not in CASES]:
        parser.error(f"no case {', '.join(unknown)}: there are {', '.join(CASES)}")
    for name in arguments.cases or CASES:
        study(name, arguments.seeds, arguments.seconds, arguments.minutes, not arguments.without_cross_check)
