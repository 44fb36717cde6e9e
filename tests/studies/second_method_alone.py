"""What the second method of `diagnose`, its inverse dynamics, says by itself of the blind benchmark's cases.

    python tests/studies/second_method_alone.py RUN [--jobs N]

RUN is the output of `haptic-teleop blind`, whose labels are opened. No first method, no free runs: the best
group of effects, where each further one gains a threshold of log-likelihood where it was not fitted. The
usual threshold, and one calibrated on every other clean recording (at most 5 % alarms), as for the other
methods of the benchmark; alarms are those of the other clean recordings.
"""

import argparse
import json
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from haptic_teleop_sim.model import load_model
from haptic_teleop_sysid.blind.sealing import open_labels, sealed_digest
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.group_search import search_groups
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales
from haptic_teleop_sysid.diagnosis.usable import records_of
from haptic_teleop_sysid.runs.diagnosis_run import load

THRESHOLDS = (6.0, 12.0, 24.0, 48.0, 96.0)


def said(case: Path) -> list[list[str]]:
    """Names, strongest first, for each threshold."""
    model = load_model(str(case / "model.yaml"))
    learn, judge = (records_of([load(str(case / part), model)]) for part in ("estimation", "validation"))
    levels = search_groups(model, learn, judge, recording_scales(model, learn)).levels
    found = []
    for least in THRESHOLDS:
        names, gain = list[str](), 0.0
        for level in levels:
            best = level[0]
            if best.gain - gain > least * (len(best.effects) - len(names)):
                gain, names = best.gain, [e.effect for e in best.effects]
        found.append(names)
    return found


def main() -> int:
    plain = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=plain)
    parser.add_argument("run", type=Path)
    parser.add_argument("--jobs", type=int, default=1)
    arguments = parser.parse_args()
    seed = str(json.loads((arguments.run / "plan.json").read_text())["seed"])
    labels = open_labels(arguments.run, seed, [], sealed_digest(arguments.run))
    cases = {n: v for n, v in labels.items() if (arguments.run / "cases" / n / "model.yaml").exists()}
    with ProcessPoolExecutor(arguments.jobs) as pool:
        told = dict(zip(cases, pool.map(said, [arguments.run / "cases" / n for n in cases]), strict=True))
    clean = [n for n in cases if cases[n]["kind"] == "clean"]
    practice, judged = clean[::2], clean[1::2]
    kept = len(THRESHOLDS) - 1
    for i in reversed(range(len(THRESHOLDS))):
        if sum(bool(told[n][i]) for n in practice) <= 0.05 * len(practice):
            kept = i
    strong = [n for n, v in cases.items() if v["kind"] == "single" and v["truth"][0]["detectability"] >= 7.2]
    pairs = [n for n, v in cases.items() if v["kind"] == "pair"]
    for title, i in (("usual", 0), ("calibrated", kept)):
        alarms = sum(bool(told[n][i]) for n in judged)
        first = sum(told[n][i][:1] == [cases[n]["truth"][0]["effect"]] for n in strong)
        both = sum({t["effect"] for t in cases[n]["truth"]} <= set(told[n][i][:2]) for n in pairs)
        print(
            f"{title} threshold {THRESHOLDS[i]:g}: alarms {alarms} of {len(judged)}, first name {first} of "
            f"{len(strong)}, both of a pair {both} of {len(pairs)}"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
