"""`haptic-teleop diagnose`: why do simulation and recording differ? Locates the mismatch, names the physics
that was left out, models it, and shows the fit improve on recordings it has not seen.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from haptic_teleop_control.command_line import run_command
from haptic_teleop_control.errors import RecordingError
from haptic_teleop_control.recording import read_recording
from haptic_teleop_sim.model import Model, load_model
from haptic_teleop_sysid.dataset import DataSet, load_dataset
from haptic_teleop_sysid.diagnosis.current import shown_by_current
from haptic_teleop_sysid.diagnosis.doubt import doubted
from haptic_teleop_sysid.diagnosis.experiment import suggest
from haptic_teleop_sysid.diagnosis.nulls import Null, beyond_chance, nulls
from haptic_teleop_sysid.diagnosis.page import diagnosis_page
from haptic_teleop_sysid.diagnosis.proof import Course, Proof, mean_percent, prove
from haptic_teleop_sysid.diagnosis.scales import within_reach
from haptic_teleop_sysid.diagnosis.search import (
    LEAST_PERCENT,
    POOR_FIT,
    SearchResult,
    search,
    search_by_simulation,
)
from haptic_teleop_sysid.diagnosis.stand import LAGS
from haptic_teleop_sysid.diagnosis.verdict import Verdict, decide_verdict
from haptic_teleop_sysid.diagnosis.words import called, chance_sentence, separating
from haptic_teleop_sysid.estimation.gauss_newton import Fit
from haptic_teleop_sysid.estimation.records import Record, record_from
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch
from haptic_teleop_sysid.results import tool_version, write_json

#: Samples below which no recording can say anything about six parameters and their noise.
FEWEST_SAMPLES = 500
#: Difference (A or N·m, relative to the rms command) up to which the measured current counts as following.
_FOLLOWS = 0.1
#: Loss of the simulated fit on unseen recordings, percent, from which a finding is not believed.
HARM = 2.0


def records_of(data: list[DataSet]) -> list[Record]:
    """Records driven by the command, refused where there is nothing to learn from."""
    records = []
    for dataset in data:
        record = record_from(dataset, commanded=True)
        if len(record) < FEWEST_SAMPLES:
            raise RecordingError(
                f"{dataset.name} has {len(record)} samples; a diagnosis needs at least {FEWEST_SAMPLES}: "
                "record for longer."
            )
        if float(np.std(record.input)) < 1e-9 or float(np.nanstd(record.measured[:, 0])) < 1e-9:
            raise RecordingError(
                f"{dataset.name}: the input or the motor angle does not change, so there is nothing to "
                "diagnose: record while the joint is driven."
            )
        records.append(record)
    return records


def sense_follows(data: list[DataSet]) -> bool:
    """Whether a measured current was recorded that follows its command without further delay."""
    for dataset in data:
        if dataset.commanded_input is None or dataset.input_source != "measured effort":
            return False
        rms = float(np.std(dataset.commanded_input))
        noise = 0.02 if dataset.input_unit == "A" else 0.0
        if float(np.std(dataset.input - dataset.commanded_input)) > _FOLLOWS * rms + noise:
            return False
    return True


def unharmful(result: SearchResult, percent: Callable[[Model], float]) -> SearchResult:
    """The search's result without the last effects while those spoil the free simulation of recordings it has
    not seen: what predicts the next sample better but runs away when it runs freely is no explanation."""
    kept = list(result.choices)
    before = percent(result.baseline.model)
    while kept and percent(kept[-1].chosen.fit.model) < before - HARM:
        kept.pop()
    if len(kept) == len(result.choices):
        return result
    final = kept[-1].chosen.fit if kept else result.baseline
    return replace(result, choices=tuple(kept), final=final, last_round=())


def diagnose(
    model: Model,
    estimation: list[DataSet],
    validation: list[DataSet],
    say=lambda text: None,
    null_count: int = 0,
) -> tuple[SearchResult, Verdict, Proof, dict[str, Any]]:
    """Search, decide and prove; the last part is the content of diagnosis.json without run time and
    version.  With ``null_count`` the search is repeated on that many simulated sets of recordings in which
    nothing is hidden, and a finding has to exceed what it finds there.
    """
    learn, judge = records_of(estimation), records_of(validation)
    n, everything = len(estimation), [*estimation, *validation]
    say("re-estimating the given structure")
    baseline = fit_from_scratch(model, learn, limits=within_reach(model))
    course = Course.of(baseline.model, everything)
    result = search(
        model,
        baseline,
        learn,
        judge,
        sense_follows=sense_follows(estimation),
        shown=shown_by_current(model, estimation, validation),
        percent=lambda candidate: float(np.mean(course.percent(candidate))),
        progress=say,
    )

    def percent(candidate: Model) -> tuple[float, float]:
        fits = course.percent(candidate, "position")
        return float(np.mean(fits[:n])), float(np.mean(fits[n:]))

    kept = unharmful(result, lambda candidate: float(np.mean(course.percent(candidate)[n:])))
    poor = min(percent(kept.final.model)) < POOR_FIT or (result.choices and not kept.choices)
    if poor and result.nameless is None:
        say("searching by free simulation")
        free = search_by_simulation(model, result.baseline, learn, judge, percent=percent, progress=say)
        gained = sum(percent(free.final.model)) - sum(percent(kept.final.model))
        if free.choices and (not kept.choices or gained > LEAST_PERCENT):
            kept = free
    chance: list[Null] = []
    if null_count:
        follows = sense_follows(estimation)
        chance = nulls(model, kept, learn, judge, null_count, sense_follows=follows, progress=say)
        kept = beyond_chance(kept, chance)
    say("doubting")
    result, doubt, stand = doubted(
        kept, learn, judge, lambda candidate: float(np.mean(course.percent(candidate)[n:]))
    )
    say("deciding")
    verdict = decide_verdict(result, learn, judge, doubt, stand.spread)
    say("simulating both models on all recordings")
    proof = prove(result.baseline.model, result.final.model, course)
    say("choosing the next experiment")
    content = {
        "schema": 1,
        "robot": model.robot,
        "joint": model.joint,
        "structure": model.structure,
        "verdict": verdict.kind,
        "where": verdict.where,
        "findings": verdict.findings,
        "fit": {
            "baseline": {
                "estimation": mean_percent(proof.baseline[:n]),
                "validation": mean_percent(proof.baseline[n:]),
            },
            "augmented": {
                "estimation": mean_percent(proof.augmented[:n]),
                "validation": mean_percent(proof.augmented[n:]),
            },
            "window_s": proof.baseline[-1].windows.seconds,
            "windows": "; ".join(
                f"{d.name}: {f.windows.why}"
                for d, f in zip(everything, proof.baseline, strict=True)
            ),
        },
        "next_experiment": next_experiment(result, verdict, learn),
        "baseline_parameters": result.baseline.model.parameter_values(),
        "innovations": {
            "what": f"portmanteau statistic over {LAGS} lags, {LAGS} on average for white innovations",
            "baseline": dict(zip(("estimation", "validation"), stand.before, strict=True)),
            "augmented": dict(zip(("estimation", "validation"), stand.after, strict=True)),
        },
        "disturbance": {
            "what": "rms torque that the observer adds at motor and arm, relative to the rms input torque",
            "baseline": disturbance(result, result.baseline),
            "augmented": disturbance(result, result.final),
        },
    }
    if chance:
        content["nulls"] = {
            "what": "score (nats) of the best explanation on simulated recordings with nothing hidden, and "
            "how many of them would have raised an alarm; a finding has to exceed the highest",
            "scores": sorted(round(one.score, 2) for one in chance),
            "alarms": sum(one.alarm for one in chance),
        }
    if doubt is not None:
        content["doubt"] = doubt.why
    if verdict.kind == "unknown" and verdict.remaining:
        best = verdict.remaining[0]
        content["residual_curve"] = {
            "equation": best.equation,
            "variable": best.name,
            "unit": best.unit,
            "value": best.centre.tolist(),
            "torque": best.torque.tolist(),
        }
    return result, verdict, proof, content


def disturbance(result: SearchResult, fit: Fit) -> dict[str, float]:
    """Rms of the fitted disturbances relative to that of the input torque, by equation."""
    torque, model = result.scales.size["torque"], fit.model
    found = {model.location("motor"): fit.noise.motor_torque / torque}
    return found if model.rigid else found | {model.location("arm"): fit.noise.arm_torque / torque}


def next_experiment(result: SearchResult, verdict: Verdict, records: list[Record]) -> dict[str, Any]:
    """What to record next, as the contract has it."""
    unsure = next((c for c in result.choices if c.ambiguous), None)
    if unsure is not None:
        rival = unsure.others[0][0]
        names = (called(unsure.chosen.effect), called(rival.effect))
        found = suggest(unsure.chosen.fit, rival.fit, names, records[0], result.scales)
        text = separating([unsure.chosen.effect, rival.effect])
        if found is None or found.expected_discrimination < 0.6:
            return {
                "why": f"{names[0]} against {names[1]}: {text}",
                "signal_generator": {},
                "expected_discrimination": 0.5 if found is None else found.expected_discrimination,
            }
        return {
            "why": f"{found.why}; also: {text}",
            "signal_generator": found.signal_generator,
            "expected_discrimination": found.expected_discrimination,
        }
    tried = [e for e in result.last_round if e.material]
    if verdict.kind in ("no_mismatch", "unknown") and tried:
        names = (called(tried[0].effect), "the structure found so far")
        found = suggest(tried[0].fit, result.final, names, records[0], result.scales)
        if found is not None:
            return {
                "why": found.why,
                "signal_generator": found.signal_generator,
                "expected_discrimination": found.expected_discrimination,
            }
    return {
        "why": "nothing is left to separate; a recording of another day would show drift",
        "signal_generator": {},
        "expected_discrimination": 1.0,
    }


def run(argv: list[str]) -> int:
    """Do what the arguments say; returns the exit status."""
    began = time.perf_counter()
    arguments = _parser().parse_args(argv)
    model = replace(load_model(arguments.model), source=arguments.model)
    console, progress = Console(), Console(stderr=True)
    with progress.status("reading recordings") as status:
        estimation = [_load(bag, model, arguments.allow_gaps) for bag in arguments.estimation]
        validation = [_load(bag, model, arguments.allow_gaps) for bag in arguments.validation]
        output = Path(arguments.output)
        output.mkdir(parents=True, exist_ok=True)
        result, verdict, proof, content = diagnose(
            model, estimation, validation, lambda text: status.update(text), arguments.nulls
        )
        status.update("writing the report")
        content |= {"runtime_s": round(time.perf_counter() - began, 2), "version": tool_version()}
        write_json(output / "diagnosis.json", content)
        replace(result.final.model, source=str(output / "augmented_model.yaml")).save(
            output / "augmented_model.yaml"
        )
        report = None
        if not arguments.no_report:
            data, records = [*estimation, *validation], records_of(estimation)
            page = diagnosis_page(result, verdict, content, proof, data, records, len(estimation))
            report = page.write(output / "report.html")
    console.print(summary(content), markup=False, highlight=False, soft_wrap=True)
    if report is not None:
        console.print(f"report: {report}", markup=False, highlight=False, soft_wrap=True)
    return 0


def summary(content: dict[str, Any]) -> str:
    """The verdict in a few lines for the terminal."""
    lines = [f"verdict: {content['verdict']}"]
    if "doubt" in content:
        lines.append(f"  because {content['doubt']}")
    for f in content["findings"]:
        numbers = ", ".join(
            f"{n} {p['value']:.4g} ± {p['std']:.1g} {p['unit']}" for n, p in f["parameters"].items()
        )
        lines.append(f"  {f['effect']} at {f['location']} ({100 * f['confidence']:.0f} %): {numbers}")
        lines += [
            f"    or {a['effect']} at {a['location']} ({100 * a['confidence']:.0f} %)"
            for a in f["alternatives"]
        ]
    if "nulls" in content:
        lines.append(f"  {chance_sentence(content['nulls'])}")
    for part in ("estimation", "validation"):
        before, after = content["fit"]["baseline"][part], content["fit"]["augmented"][part]
        lines.append(f"  {part}: " + ", ".join(f"{n} {before[n]:.1f} -> {after[n]:.1f} %" for n in before))
    return "\n".join(lines)


def _count(text: str) -> int:
    number = int(text)
    if number < 0:
        raise argparse.ArgumentTypeError(f"{text} is negative: give how many to simulate, or 0 for none")
    return number


def _load(bag: str, model: Model, allow_gaps: bool) -> DataSet:
    return load_dataset(read_recording(bag), model, bag, allow_gaps)


def main(argv: list[str] | None = None) -> int:
    """Entry point: exit status 0 when a verdict was reached, 2 for bad arguments or an unusable recording."""
    return run_command(run, argv)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="haptic-teleop diagnose", description=__doc__)
    parser.add_argument("--model", required=True, metavar="MODEL.yaml", help="what the lab believes")
    parser.add_argument(
        "--estimation", nargs="+", required=True, metavar="BAG", help="recordings to learn from"
    )
    parser.add_argument(
        "--validation",
        nargs="+",
        required=True,
        metavar="BAG",
        help="other recordings, of another amplitude or band, on which a finding must stand up",
    )
    parser.add_argument(
        "--output",
        required=True,
        metavar="DIR",
        help="where diagnosis.json, augmented_model.yaml and report.html go",
    )
    parser.add_argument(
        "--nulls",
        type=_count,
        default=0,
        metavar="N",
        help="repeat the search on N simulated sets of recordings with nothing hidden (some seconds each, on "
        "all cores): how often would this machine, experiment and noise raise a false alarm? A finding must "
        "exceed the best of them; 19 make a level of 5 %%",
    )
    parser.add_argument("--no-report", action="store_true", help="no page: for many diagnoses in a row")
    parser.add_argument(
        "--allow-gaps", action="store_true", help="leave holes in a recording out instead of refusing it"
    )
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
