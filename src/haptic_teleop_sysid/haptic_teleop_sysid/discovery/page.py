"""The report of one discovery: what was hidden, what was said, how simulation and recording came together."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sysid.discovery.outcome import Judgement
from haptic_teleop_sysid.discovery.overlay import AUGMENTED, LAB, REFITTED, Fits, mean
from haptic_teleop_sysid.report import Link, Page, Plot, Section, unit_text, with_error
from haptic_teleop_sysid.runs.comparison_pictures import percent_text

_GOOD = {"right": "good", "in the set": "fair", "unknown": "fair", "right place": "bad"}
_ROWS = {
    LAB: "the lab's model, as it was",
    REFITTED: "the same structure, re-estimated",
    AUGMENTED: "the augmented model",
}


def discovery_page(
    content: Mapping[str, Any],
    judgement: Judgement,
    scenario1: Plot,
    validation: Plot,
) -> Page:
    """Return the page; `content` is what discover.json holds."""
    hidden, plant = content["label"]["truth"][0], content["plant"]
    page = Page(
        "Discovery of a concealed effect",
        f"seed {content['seed']}, {hidden['location'].split('_')[0]} of a 2DSFJ simulated by "
        f"{'MuJoCo' if plant == 'mujoco_sim' else 'sfj_sim with a sealed effect file'}, "
        f"{content['mode']}",
    )
    fits = content["fits"]
    _conclude(page, hidden, judgement)
    if judgement.beside and judgement.outcome in ("right", "in the set"):
        page.verdict("fair", f"Also stated, and not hidden: {'; '.join(judgement.beside)}.")
    for note in content["notes"]:
        page.verdict("fair", f"{note[0].upper()}{note[1:]}.")
    for part, label in (("scenario1", "scenario 1"), ("validation", "validation")):
        values = [f"{percent_text(mean(fits[part][name]))}" for name in (LAB, REFITTED, AUGMENTED)]
        note = f"lab's model → augmented; re-estimated: {values[1]} %"
        page.key_figure(f"{values[0]} → {values[2]} %", f"fit to {label}", note)
    _sizes(page.section("What was hidden, and what was estimated"), content, judgement)
    force = page.section(
        "Scenario 1: force control with contact",
        "The recording of the concealed robot, and the scenario run once more with each model in the "
        "simulated plant, in closed loop: nothing but the command is the same.",
    )
    force.plot(scenario1, "Scenario 1: recorded, and simulated before and after")
    _table(force, fits["scenario1"])
    open_ = page.section(
        "Validation: an acquisition that nothing was fitted to",
        "It chose among explanations. Shown is the simulated response to the recorded command, nothing "
        "corrected along the way.",
    )
    open_.plot(validation, "Validation: recorded, and simulated before and after")
    _table(open_, fits["validation"])
    _secrecy(page.section("How the secret was kept", folded=True), content)
    page.section("To look further").table(
        ["what", "where"],
        [[what, _where(where)] for what, where in content["files"].items()],
    )
    return page


def _conclude(page: Page, hidden: Mapping[str, Any], judgement: Judgement) -> None:
    """The first line: whether the answer is right, and what it was; sizes stand in the first section."""
    said = "; ".join(judgement.score["said"]) or "nothing"
    truth = f"{hidden['effect']} @ {hidden['location']}"
    told = truth if judgement.right else f"hidden was {truth}, named was {said}"
    page.conclude(
        _GOOD.get(judgement.outcome, "bad"),  # type: ignore[arg-type]
        f"{judgement.sentence.capitalize()}: {told}.",
        "open the diagnosis' own report (the last section says where): it tells what it rests on.",
    )
    page.verdict("plain", f"Verdict of the diagnosis: {judgement.diagnosis['verdict']}.")


def _where(path: str) -> str:
    """A file as a link, a folder or several by their names."""
    one = path.endswith((".html", ".json", ".yaml")) and "," not in path
    return Link(path, path) if one else path


def _secrecy(section: Section, content: Mapping[str, Any]) -> None:
    section.text(
        "Before any recording was made the label (the effect, its place and size, the robot's parameters "
        "and a random nonce) was sealed, and its SHA-256 digest was printed. The diagnosis ran as a process "
        "of its own that got two recordings and the lab's model; the plant's files were gone by then. "
        "Afterwards the seal was opened: label.json has this digest."
    )
    section.table(["SHA-256 of label.json"], [[content["digest"]]])


def _sizes(section: Section, content: Mapping[str, Any], judgement: Judgement) -> None:
    truth = content["label"]["truth"][0]
    estimated = {}
    for finding in judgement.diagnosis.get("findings") or []:
        if (finding["effect"], finding["location"]) == (truth["effect"], truth["location"]):
            estimated = finding["parameters"]
    rows = []
    for name, value in truth["parameters"].items():
        found = estimated.get(name)
        text = "–" if found is None else with_error(found["value"], found["std"])
        rows.append([f"{truth['effect']} {name}", _unit(truth, name), f"{value:.4g}", text])
    section.table(["parameter", "unit", "hidden", "estimated"], rows, "Sizes, with their standard errors")
    rows = []
    for finding in judgement.diagnosis.get("findings") or []:
        numbers = ", ".join(
            f"{n} {with_error(p['value'], p['std'], p['unit'])}" for n, p in finding["parameters"].items()
        )
        others = ", ".join(f"{a['effect']} @ {a['location']}" for a in finding["alternatives"]) or "–"
        rows.append(
            [
                f"{finding['effect']} @ {finding['location']}",
                numbers,
                f"{100 * finding['confidence']:.0f} %",
                others,
            ]
        )
    if rows:
        header = ["finding", "parameters", "confidence", "alternatives"]
        section.table(header, rows, "As diagnosis.json has it")


def _table(section: Section, fits: Mapping[str, Fits]) -> None:
    signals = list(next(iter(fits.values())))
    rows = [
        [text, *(percent_text(fits[name][signal]) for signal in signals), percent_text(mean(fits[name]))]
        for name, text in _ROWS.items()
    ]
    section.table(["model", *signals, "mean"], rows, "Fit in percent: 100·(1 − ‖y − ŷ‖ / ‖y − mean y‖)")


def _unit(truth: Mapping[str, Any], name: str) -> str:
    """Unit of a hidden effect's parameter as a reader writes it; none where the table does not have it."""
    entry = EFFECTS.get(truth["effect"])
    known = entry is not None and name in entry.parameter_names
    return unit_text(entry.parameter(name).unit) if entry is not None and known else ""
