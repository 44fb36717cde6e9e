"""`haptic-teleop dataset`: look at recordings before anything is estimated.

What is there, what is suspicious (gaps, duplicates, jitter, stamps that run backward, values that are no
numbers), and, with a model, whether the excitation can teach it: spectrum, and the standard errors to expect.
"""

from __future__ import annotations

import argparse
import shlex
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from rich.console import Console

from haptic_teleop_control.command_line import ArgumentParser, run_command
from haptic_teleop_control.recording import JointStateSeries, Recording, bag_problems
from haptic_teleop_sim.model import Model, load_model
from haptic_teleop_sysid.commands.treatment_options import (
    add_mapping_option,
    add_treatment_options,
    treatment_of,
    treatment_words,
)
from haptic_teleop_sysid.estimation.excitation import NOT_FITTED, Excitation, excitation, refuse_idle
from haptic_teleop_sysid.estimation.records import records_from
from haptic_teleop_sysid.logs.opened import open_recording
from haptic_teleop_sysid.logs.story import reported, tell
from haptic_teleop_sysid.recordings.dataset import DataSet, load_dataset
from haptic_teleop_sysid.recordings.parameter_units import Units
from haptic_teleop_sysid.recordings.preparation import prepare, refuse_huge
from haptic_teleop_sysid.recordings.recorded_parameters import recorded_units
from haptic_teleop_sysid.report import (
    Page,
    Panel,
    Plot,
    Series,
    Status,
    claim_output_directory,
    save_png,
    unit_text,
)
from haptic_teleop_sysid.report.terminal import say
from haptic_teleop_sysid.results import tool_version, write_json
from haptic_teleop_sysid.runs.comparison_pictures import input_panel
from haptic_teleop_sysid.runs.form_errors import widened_by_form
from haptic_teleop_sysid.runs.shape_starts import shape_starts

ILL_CONDITIONED = 1e6
"""Condition of the scaled information beyond which parameters can hardly be told apart."""
SIGNALS_DRAWN = 12
"""Signals of a recording that a picture without a model shows."""
WELL_KNOWN = 0.2
"""Expected standard error, relative, up to which a recording is rich enough for a parameter."""

_UNSETTLED = (
    "whether the excitation is rich enough is not known: the quick fit found no optimum, so the errors that "
    "the page expects assume the noise of a model that does not fit; `estimate` tells."
)
_ODD = "Start from other values, or ask `diagnose` for what else it may be."


@dataclass(frozen=True)
class Look:
    """One recording: `quality` by topic; `dataset`, `told` and `excitation` where a model was given."""

    recording: Recording
    quality: dict[str, Any]
    dataset: DataSet | None = None
    told: tuple[str, ...] = ()
    excitation: Excitation | None = None

    @property
    def problems(self) -> list[str]:
        """Everything suspicious, in sentences."""
        found = [*self.recording.problems]
        for quality in self.quality.values():
            found += [p for p in quality.problems if p not in found]
        return found


def look(name: str, model: Model | None, arguments: argparse.Namespace) -> Look:
    """Read one recording and judge it."""
    refuse_huge(name)
    recording = open_recording(name, arguments.mapping)
    quality = {topic: bag_problems(series, topic) for topic, series in recording.topics.items()}
    if model is None:
        return Look(recording, quality)
    # Holes are reported here, not refused: that is what this command is for.
    with reported({name: recording.problems}):
        dataset = load_dataset(recording, model, name, allow_gaps=True)
        refuse_idle(dataset)
        dataset, told = prepare(dataset, recording, model, treatment_of(arguments))
        return Look(recording, quality, dataset, tuple(told), _judged(model, dataset))


def _judged(model: Model, dataset: DataSet) -> Excitation:
    """The excitation, with the errors that `estimate` would give."""
    records = records_from(dataset)
    found = excitation(model, [dataset], shape_starts(model, records))
    return replace(found, expected=widened_by_form(found.expected, found.fit, records)[0])


def judgement(one: Look) -> list[tuple[str, str]]:
    """(status, sentence): what a report says first."""
    said = [("fair", f"{sentence}.") for sentence in one.problems]
    if not said:
        said.append(
            ("good", "No gap, no duplicate, no stamp that runs backward, no value that is no number.")
        )
    if one.excitation is not None:
        expected = one.excitation.expected
        low, high = one.excitation.band
        said.append(("plain", f"95 % of the input's power lie between {low:.2g} and {high:.2g} Hz."))
        for name, why in expected.undetermined.items():
            said.append(("bad", f"{name} could not be determined: {why}."))
        if expected.condition > ILL_CONDITIONED:
            said.append(
                (
                    "bad",
                    f"the parameters are hard to tell apart (condition {expected.condition:.1e}): excite "
                    "more "
                    "frequencies.",
                )
            )
        odd = one.excitation.contradictions
        for effect, why in odd.items():
            said.append(("bad", f"{effect} cannot be judged: in a quick fit {why}. {_ODD}"))
        if not one.excitation.fit.converged or one.excitation.fit.message == NOT_FITTED:
            said.append(("fair", _UNSETTLED))
        elif unsure := _unsure(one):
            listed = ", ".join(f"{name} ± {100 * share:.0f} %" for name, share in unsure.items())
            said.append(("fair", f"not well known from this recording: {listed}; excite more, or longer."))
        elif expected.condition <= ILL_CONDITIONED and not expected.undetermined and not odd:
            said.append(
                (
                    "good",
                    f"the excitation is rich enough for this model (condition {expected.condition:.1e}).",
                )
            )
    return said


def _unsure(one: Look) -> dict[str, float]:
    """Parameters whose expected standard error is a larger share of their size than WELL_KNOWN, with it."""
    if one.excitation is None:
        return {}
    expected, values = one.excitation.expected, one.excitation.fit.model.parameter_values()
    shares = {
        name: float(std) / abs(values[name])
        for name, std in zip(expected.names, expected.std, strict=True)
        if name not in expected.undetermined and values[name]
    }
    return {name: share for name, share in shares.items() if share > WELL_KNOWN}


def as_json(name: str, one: Look) -> dict[str, Any]:
    """What dataset.json says of one recording."""
    content: dict[str, Any] = {
        "bag": name,
        "complete": one.recording.complete,
        "experiment": one.recording.experiment,
        "topics": {topic: asdict(quality) for topic, quality in one.quality.items()},
        "problems": one.problems,
        "judgement": [sentence for _, sentence in judgement(one)],
    }
    if one.dataset is not None and one.excitation is not None:
        d, e = one.dataset, one.excitation
        values = e.fit.model.parameter_values()
        content |= {
            "samples": len(d),
            "period_s": d.dt,
            "start_s": d.start,
            "end_s": float(d.time[-1]),
            "input": {
                "source": d.input_source,
                "unit": d.input_unit,
                "rms": float(np.std(d.input)),
                "peak": float(np.max(np.abs(d.input))),
            },
            "signals": {
                n: {"unit": d.units()[n], "min": float(np.min(v)), "max": float(np.max(v))}
                for n, v in d.signals().items()
            },
            "treatment": one.told,
            "band_hz": e.band,
            "condition": e.expected.condition,
            "expected_std": dict(zip(e.expected.names, e.expected.std, strict=True)),
            "expected_relative_std": {
                n: s / abs(values[n]) if values[n] else None
                for n, s in zip(e.expected.names, e.expected.std, strict=True)
            },
            "undetermined": e.expected.undetermined,
        }
    return content


def picture(one: Look) -> Plot:
    """The data set's input and outputs; without a model the signals of the recording's topics."""
    if one.dataset is not None:
        d = one.dataset
        panels = [input_panel(d)]
        panels += [Panel(n, d.units()[n], [Series("measured", d.time, v)]) for n, v in d.signals().items()]
        return Plot(panels, "time since the recording's first sample (s)")
    panels = []
    for topic, series in one.recording.topics.items():
        for joint in series.names:
            units = recorded_units(one.recording.experiment, joint)
            for field, unit in (("position", units["position"]), ("effort", units["input"])):
                if len(panels) < SIGNALS_DRAWN and _holds(series, joint, field):
                    line = Series("", series.time(), series.signal(joint, field))
                    panels.append(Panel(f"{topic} {joint}.{field}", unit_text(unit), [line]))
    return Plot(panels)


def _holds(series: JointStateSeries, joint: str, field: str) -> bool:
    return getattr(series, field) is not None and bool(np.any(np.isfinite(series.signal(joint, field))))


def spectrum_picture(one: Excitation, unit: str) -> Plot:
    """Power density of input and motor speed over frequency, in decibels."""
    inside = (one.frequency > 0.0) & (one.frequency < 0.5 * one.frequency[-1])
    panels = []
    for title, power in (
        (f"input, dB re 1 {_squared(unit)}/Hz", one.input_spectrum),
        ("motor speed, dB re 1 (rad/s)²/Hz", one.response_spectrum),
    ):
        decibels = 10.0 * np.log10(np.maximum(power[inside], 1e-30))
        line = Series("", np.asarray(one.frequency[inside]), np.asarray(decibels))
        panels.append(Panel(title, "dB", [line], spans=[one.band]))
    return Plot(panels, "frequency (Hz); shaded: 95 % of the input's power")


def _squared(unit: str) -> str:
    """The square of a unit: that of a product in parentheses."""
    text = unit_text(unit) or "1"
    return f"{text}²" if text.isalpha() else f"({text})²"


def page(looks: dict[str, Look], next_steps: Sequence[tuple[str, str]] = ()) -> Page:
    """The report; ``next_steps``: what to do after it, and the command."""
    report = Page("Recordings before identification", ", ".join(looks))
    report.conclude(*_conclusion(looks))
    for name, one in looks.items():
        for status, sentence in judgement(one):
            report.verdict(status, f"{name}: {sentence}")  # pyright: ignore[reportArgumentType]
    for name, one in looks.items():
        section = report.section(name)
        section.plot(picture(one), f"Signals of {name}")
        for sentence in one.told:
            section.text(f"{sentence[0].upper()}{sentence[1:]}.")
        _expected(report, name, one)
    _quality(report, looks)
    if next_steps:
        report.section("What comes next").commands(next_steps)
    return report


def next_steps(arguments: argparse.Namespace) -> list[tuple[str, str]]:
    """What to do after a look at these recordings, with the command."""
    bags = list(dict.fromkeys(arguments.bag))
    more = ["--mapping", arguments.mapping] if arguments.mapping else []
    if arguments.model is None:
        words = ["haptic-teleop", "dataset", "--bag", *bags, *more, "--model", "MODEL.yaml"]
        what = "Look again with a model, to hear whether the excitation teaches it."
        return [(what, shlex.join([*words, "--output", f"{arguments.output}_with_model"]))]
    words = ["haptic-teleop", "estimate", "--model", arguments.model, "--bag", *bags, *more]
    treatment = treatment_words(arguments)
    what = "Estimate the model's parameters; add `--validation BAG` to check them on another recording."
    return [(what, shlex.join([*words, *treatment, "--output", f"{arguments.output}_estimate"]))]


def _conclusion(looks: dict[str, Look]) -> tuple[Status, str, str]:
    """Whether these recordings can be used, and what to do."""
    said = [(status, f"{name}: {text}") for name, one in looks.items() for status, text in judgement(one)]
    count = f"{len(looks)} recordings" if len(looks) > 1 else "The recording"
    bad, fair = ([text for status, text in said if status == which] for which in ("bad", "fair"))
    if bad:
        todo = "record again with a richer excitation, or fix in the model what cannot be determined."
        return "bad", f"{count} cannot teach this model everything. {bad[0]}", todo
    if fair:
        return "fair", f"{count} can be read, with something to know first. {fair[0]}", (
            "see at that time in the picture what happened; then estimate, or record again."
        )  # fmt: skip
    judged = any(one.excitation is not None for one in looks.values())
    todo = "estimate from it." if judged else "give --model to hear whether the excitation teaches it."
    return "good", f"{count} {'are' if len(looks) > 1 else 'is'} complete and clean.", todo


def _quality(report: Page, looks: dict[str, Look]) -> None:
    """Stamps and values of every topic."""
    rows = [
        [
            topic,
            q.count,
            f"{q.rate:.4g}",
            f"{q.duration:.3f}",
            f"{q.jitter * 1e3:.3f}",
            q.lost,
            len(q.gaps),
            q.duplicates,
            q.backwards,
            sum(q.non_finite.values()),
            name,
        ]
        for name, one in looks.items()
        for topic, q in one.quality.items()
    ]
    header = ["topic", "samples", "rate (Hz)", "length (s)", "jitter (ms)", "lost", "gaps", "duplicates"]
    header += ["backward", "not finite", "recording"]
    report.section("Stamps and values").table(header, rows, "Every topic of every recording")


def _expected(report: Page, name: str, one: Look) -> None:
    """What an estimate can be expected to reach, and the spectra that say why."""
    if one.excitation is None or one.dataset is None:
        return
    e, values = one.excitation, one.excitation.fit.model.parameter_values()
    units = Units.of(e.fit.model, one.dataset)
    rows = [
        [
            n,
            unit_text(units.of_parameter(e.fit.model, n)),
            f"{values[n]:.4g}",
            "–" if not np.isfinite(s) else f"{s:.2g}",
            e.expected.undetermined.get(n, "" if not values[n] else f"{100 * s / abs(values[n]):.2g} %"),
        ]
        for n, s in zip(e.expected.names, e.expected.std, strict=True)
    ]
    section = report.section(f"What {name} can teach")
    section.table(
        ["parameter", "unit", "value by a quick fit", "std. error to expect", "relative"],
        rows,
        "What an estimate can be expected to reach: standard errors of a quick fit",
    )
    section.plot(spectrum_picture(e, one.dataset.input_unit), "Power density of input and response")


def run(argv: list[str]) -> int:
    """Do what the arguments say; returns the exit status."""
    began = time.perf_counter()
    arguments = _parser().parse_args(argv)
    model = None if arguments.model is None else load_model(arguments.model)
    console, screen = Console(), Console(stderr=True)
    with screen.status("reading recordings"):
        looks = {name: look(name, model, arguments) for name in dict.fromkeys(arguments.bag)}
    tell(screen, {name: one.recording.experiment for name, one in looks.items()}, arguments.verbose)
    output = claim_output_directory(arguments.output, "dataset.json", arguments.overwrite)
    with screen.status("writing the report"):
        for number, one in enumerate(looks.values(), start=1):
            save_png(picture(one), output / ("dataset.png" if number == 1 else f"dataset-{number}.png"))
        path = page(looks, next_steps(arguments)).write(output / "report.html")
        content = {"schema": 1, "recordings": [as_json(name, one) for name, one in looks.items()]}
        content |= {"runtime_s": time.perf_counter() - began, "version": tool_version()}
        write_json(output / "dataset.json", content)
    for name, one in looks.items():
        for _, sentence in judgement(one):
            say(console, f"{name}: {sentence}")
    say(console, f"report: {path}")
    return 0


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point: 0 when the report was written, whatever it says; 2 for bad arguments or unusable
    recordings."""
    return run_command(run, None if argv is None else list(argv))


def _parser() -> argparse.ArgumentParser:
    parser = ArgumentParser(
        prog="haptic-teleop dataset", description="Look at recordings before anything is estimated."
    )
    parser.add_argument("--bag", nargs="+", required=True, metavar="BAG", help="recordings")
    parser.add_argument("--model", metavar="MODEL.yaml", help="judge the excitation for this model")
    parser.add_argument(
        "--output", required=True, metavar="DIR", help="where report.html and dataset.json go"
    )
    parser.add_argument(
        "--overwrite", action="store_true", help="replace the results of an earlier run in DIR"
    )
    add_mapping_option(parser)
    add_treatment_options(parser)
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
