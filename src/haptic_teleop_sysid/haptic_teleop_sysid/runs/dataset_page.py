"""The page on recordings before anything is estimated."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from haptic_teleop_sysid.recordings.parameter_units import Units
from haptic_teleop_sysid.report import Page, Status, unit_text
from haptic_teleop_sysid.runs.dataset_look import Look, judgement
from haptic_teleop_sysid.runs.dataset_pictures import signals_picture, spectrum_picture


def dataset_page(looks: dict[str, Look], next_steps: Sequence[tuple[str, str]] = ()) -> Page:
    """Return the report on recordings by name; ``next_steps``: what to do after it, and the command."""
    report = Page("Recordings before identification", ", ".join(looks))
    report.conclude(*_conclusion(looks))
    for name, one in looks.items():
        for status, sentence in judgement(one):
            report.verdict(status, f"{name}: {sentence}")
    for name, one in looks.items():
        section = report.section(name)
        section.plot(signals_picture(one), f"Signals of {name}")
        for sentence in one.told:
            section.text(f"{sentence[0].upper()}{sentence[1:]}.")
        _expected(report, name, one)
    _quality(report, looks)
    if next_steps:
        report.section("What comes next").commands(next_steps)
    return report


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
