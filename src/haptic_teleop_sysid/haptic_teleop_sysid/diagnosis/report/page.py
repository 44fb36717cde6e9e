"""The report of a diagnosis: one page that one would show to a colleague."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.recordings.dataset import DataSet
from haptic_teleop_sysid.recordings.parameter_units import Units
from haptic_teleop_sysid.recordings.small_motion import hardly_moving
from haptic_teleop_sysid.report import Page, Panel, Plot, Series, unit_text

from ..decision.search.rounds import SearchResult
from ..decision.verdict import Verdict
from ..evidence.proof import MODELS, PARTS, Proof
from ..evidence.residual import left_over
from . import page_columns
from .inverse_dynamics import inverse_dynamics_section
from .page_law import LawCurve, condition_plot, law_curves, law_plot
from .page_lead import lead
from .page_map import map_section
from .page_reading import reading_section
from .page_reasons import curves_table, given_up, reasons, tried
from .page_steps import Origin, steps
from .summary import PART_LABELS, percent

#: What the three models mean, as `report.roles` has it.
ROLES = ("given", "re-estimated", "augmented")
_OVER_TIME = (
    " Over time the torque is that in the direction of the law, which swings with the motion: it grows as "
    "the change does."
)


def diagnosis_page(
    result: SearchResult,
    verdict: Verdict,
    content: dict[str, Any],
    proof: Proof,
    estimation: Sequence[Record],
    units: Units,
    origin: Origin,
) -> Page:
    """The page of one diagnosis; ``estimation``: what was fitted to; ``units`` of the machine; ``origin``:
    what the next commands are made of."""
    verdict = replace(verdict, findings=units.restated_all(verdict.findings))
    model = result.baseline.model
    count = sum(len(proof.parts[part]) for part in PARTS)
    page = Page(f"Diagnosis of {model.robot} {model.joint}", f"{model.structure}; {count} recordings")
    lead(page, verdict, content, {part: hardly_moving(proof.parts[part]) for part in PARTS})
    curves = law_curves(result, estimation, content.get("stand_in"))
    _missing(page, verdict, curves, units)
    page_columns.fits(page, content, proof)
    _best(page, proof)
    page_columns.parameters(page, content)
    reading_section(page, content, units)
    map_section(page, content, units)
    reasons(page, verdict, content, curves)
    steps(page, content, origin)
    curves_table(page, verdict)
    _left_over(page, result, estimation[0], unit_text(units.force))
    for part in PARTS:
        for number, dataset in enumerate(proof.parts[part]):
            if (part, number) != _shown(proof):
                title = f"{dataset.name} ({part}: {PART_LABELS[part]})"
                page.section(title, folded=True).plot(
                    _response(dataset, proof, part, number), f"Measured and simulated, {dataset.name}"
                )
    inverse_dynamics_section(page, content)
    given_up(page, result)
    tried(page, result)
    seen = [(name, p) for name, told in content["recordings"].items() for p in told]
    if seen:
        page.section("What is odd about the recordings").table(("recording", "what was seen"), seen)
    return page


def _missing(page: Page, verdict: Verdict, curves: Sequence[LawCurve], units: Units) -> None:
    """The curve that shows what is missing: with its law where it has one."""
    plot = law_plot(curves, units) if curves else condition_plot(verdict, units)
    if plot is None:
        return
    caption = (
        "Torque that the equations of motion lack on the recordings fitted to, against what it follows "
        "(dots: means of as many samples each): without the finding, with it, and the law that was named."
        + (_OVER_TIME if any(c.there for c in curves) else "")
        + ("" if verdict.findings else " It only stands in: it is not believed to be what is missing.")
        + _only(verdict, curves)
        if curves
        else "Torque that the observer has to add, against what it follows most (dots: means)."
    )
    page.section("What is missing" if verdict.kind != "no_mismatch" else "What is left").plot(plot, caption)


def _only(verdict: Verdict, curves: Sequence[LawCurve]) -> str:
    """What is said where some of the laws drawn only stand in."""
    if verdict.kind != "unknown" or not verdict.findings or len(curves) <= len(verdict.findings):
        return ""
    named = " and ".join(f"{f['effect']} at {f['location']}" for f in verdict.findings)
    return f" Of these {named} is believed; the rest stands in."


def _shown(proof: Proof) -> tuple[str, int]:
    """The recording that says most about others: the first of the test, else of the validation."""
    return proof.best_part, 0


def _best(page: Page, proof: Proof) -> None:
    part, number = _shown(proof)
    dataset = proof.parts[part][number]
    page.sections[-1].plot(
        _response(dataset, proof, part, number),
        f"{dataset.name} ({PART_LABELS[part]}): measured, and simulated by the three models.",
    )


def _left_over(page: Page, result: SearchResult, record: Record, force: str) -> None:
    """The torque that the observer adds, over time."""
    before, after = left_over(result.baseline, record), left_over(result.final, record)
    panels = []
    for channel, name in enumerate(("motor",) if result.baseline.model.rigid else ("motor", "arm")):
        lines = [Series("re-estimated", before.time, before.torque[:, channel], "re-estimated")]
        if result.choices:
            lines.append(Series("augmented", after.time, after.torque[:, channel], "augmented"))
        panels.append(Panel(f"left-over torque at the {name}", force, lines))
    page.section("What is left over in time", folded=True).plot(
        Plot(panels),
        "Torque that the observer has to add to follow the first recording: with the structure alone, and "
        "with what was found.",
    )


def _response(dataset: DataSet, proof: Proof, part: str, number: int) -> Plot:
    panels = []
    for signal, measured in dataset.signals().items():
        lines, fits = [Series("measured", dataset.time, measured)], []
        low, high = float(np.min(measured)), float(np.max(measured))
        room = 0.6 * (high - low)
        for model, label, role in zip(MODELS, page_columns.HEADS, ROLES, strict=True):
            fit = proof.fits[model][part][number]
            simulated = np.clip(fit.simulated[signal], low - room, high + room)
            lines.append(Series(label, dataset.time, simulated, role))
            fits.append(f"{label} {percent(fit.percent[signal])} %")
        panels.append(Panel(signal, dataset.units()[signal], lines, note=", ".join(fits)))
    return Plot(panels).with_difference()
