"""The first lines of a diagnosis: the one sentence that a lab acts on, and what to do next."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from haptic_teleop_sim.effects import MEASURED
from haptic_teleop_sysid.recordings.small_motion import judged
from haptic_teleop_sysid.report import Page, Status, with_error

from ..decision.adequacy import nothing_shown
from ..decision.verdict import Verdict
from ..decision.words import acts
from ..inputs.cuts import ONLY
from ..policy import SURE
from .summary import (
    LIMIT,
    PART_LABELS,
    explains_sentence,
    found_is_better,
    moved_sentence,
    nameless_at,
    percent,
)


def lead(
    page: Page, verdict: Verdict, content: dict[str, Any], still: Mapping[str, set[str]] | None = None
) -> None:
    """Conclusion, key figures and checks of the page; ``still``: by part, signals that hardly move."""
    status, happened = _headline(verdict, content)
    worse = content["worse_than_given"]
    note = None
    if worse is not None and found_is_better(content):  # it is about the structure without what was found
        status, note = "fair", f"{worse['sentence']}."
    elif worse is not None:
        status, happened = "bad", f"{worse['sentence']}. {happened}"
    todo = _todo(verdict, content)
    if (backwards := content.get("input_sign")) is not None:
        status, todo = "bad", f"{backwards['remedy']}."
        happened = f"{_capital(backwards['what'])}. {happened}"
    if (apart := content.get("recordings_apart")) is not None:
        status, todo = "bad", f"{apart['remedy']}. Then: {todo}"
        happened = f"{_capital(apart['what'])}. {happened}"
    page.conclude(status, happened, todo)
    for f in verdict.findings:
        page.key_figure(f"{100 * f['confidence']:.0f} %", f"{f['effect']} at {f['location']}", "confidence")
    _gained(page, content, still or {})
    if note is not None:
        page.verdict("fair", note)
    explained = explains_sentence(content)
    if explained:
        page.verdict("fair", explained)
    moved = moved_sentence(content)
    if moved:
        page.verdict("fair" if content["parameters_moved"] else "good", moved.replace("->", "→"))
    for name, seen in content.get("recordings", {}).items():
        for problem in (one for one in seen if one.startswith(ONLY)):
            page.verdict("bad", f"{name}: {problem}. Record it again without holes.")
        # A unit, a sign or a column that is asked about comes before what follows from it.
        for problem in (one for one in seen if "?" in one):
            page.verdict("fair", f"{name}: {problem.rstrip('.')}")
    if "doubt" in content:
        page.verdict("fair", f"Why no name is given: {content['doubt']}.")
    if (instead := content.get("stand_in")) is not None:
        page.verdict("fair", f"To simulate with: {instead['what']}.")
    if "beside" in content:
        page.verdict("fair", f"Beside what is named, {content['beside']}.")


def _capital(sentence: str) -> str:
    return sentence[:1].upper() + sentence[1:]


def _headline(verdict: Verdict, content: dict[str, Any]) -> tuple[Status, str]:
    places = ", ".join(f"{nameless_at(w, content)} and {acts(w['condition'])}" for w in verdict.where)
    if verdict.kind == "identified":
        named = " and ".join(_named(f) for f in verdict.findings)
        if any(f["confidence"] < SURE for f in verdict.findings):
            return "fair", f"The missing physics probably has a name: {named}."
        return "good", f"The missing physics has a name: {named}."
    if verdict.kind == "ambiguous":
        sure = " and ".join(_named(f) for f in verdict.findings if not _unsure(f))
        named = f"Part of the missing physics has a name: {sure}. Beside it these" if sure else "These"
        return "fair", f"{named} recordings cannot tell {_rivals(verdict)} apart."
    if verdict.kind == "unknown":
        sure = " and ".join(_with_rivals(f) for f in verdict.findings)
        if sure and nothing_shown(verdict.adequacy):
            return "fair", (
                f"What is missing resembles {sure}. But with it recordings are simulated worse than by your "
                "own model, so nothing is shown."
            )
        if sure and verdict.adequacy is not None:
            return "fair", (
                f"Part of what is missing is probably {sure}. The rest no known effect explains; it sits at "
                f"{places or 'no single place'}."
            )
        beside = f" Beside it there is probably {sure}." if sure else ""
        return "fair", (
            f"Something is missing that no known effect explains; it sits at {places or 'no single place'}."
            f"{beside}"
        )
    if content["parameters_moved"]:
        return "fair", moved_sentence(content).replace("->", "→")
    return "good", (
        "The given structure, re-estimated, explains these recordings; nothing is missing that they "
        "could show."
    )


def _named(f: dict[str, Any]) -> str:
    """An effect with its place and sizes."""
    sizes = ", ".join(f"{name.replace('_', ' ')} {parameter_text(p)}" for name, p in f["parameters"].items())
    return f"{f['effect']} at {f['location']} ({sizes})" if sizes else f"{f['effect']} at {f['location']}"


def _with_rivals(f: dict[str, Any]) -> str:
    """An effect with its place and sizes, and what else it may be."""
    rivals = f["alternatives"] if _unsure(f) else []
    return " or ".join([_named(f), *(f"{a['effect']} at {a['location']}" for a in rivals)])


def parameter_text(p: dict[str, Any]) -> str:
    """A finding's parameter with its error and unit, and whether it is at a bound."""
    bound = f" ({LIMIT[p['at_bound']]})" if "at_bound" in p else ""
    return f"{with_error(p['value'], p['std'], p['unit'])}{bound}"


def _unsure(f: dict[str, Any]) -> bool:
    rivals = sum(a["confidence"] for a in f["alternatives"])
    return rivals > (1.0 - SURE) * (rivals + f["confidence"])


def _rivals(verdict: Verdict) -> str:
    names = [n for f in verdict.findings if _unsure(f) for n in (f, *f["alternatives"])]
    return " or ".join(dict.fromkeys(f"{n['effect']} at {n['location']}" for n in names))


def _todo(verdict: Verdict, content: dict[str, Any]) -> str:
    held, why = content["augmented_model"]["holds"], content["next_experiment"]["why"]
    model = f"augmented_model.yaml holds {content['augmented_model']['what']}"
    law = (content.get(MEASURED.name) or {}).get("law")
    if verdict.kind == "unknown" and law is not None:
        return (
            f"read the law in {law['file']}; if it means something to you, add it and diagnose again. Then "
            f"record the next experiment: {why}."
        )
    if content.get("reading_error") is not None:
        return f"{why}."
    if verdict.kind in ("ambiguous", "unknown"):
        return f"record the next experiment: {why}."
    if held == "given":
        return f"keep your model ({model}), and record the next experiment: {why}."
    if verdict.kind == "identified":
        if any(f["confidence"] < SURE for f in verdict.findings):
            return f"do not rely on the name yet ({model}). Record the next experiment: {why}."
        return f"simulate with it: {model}. Then compare it on another recording; the commands are below."
    if content["parameters_moved"]:
        return f"take the new numbers over: {model}."
    return f"nothing: your model may stay as it is ({model})."


def _gained(page: Page, content: dict[str, Any], still: Mapping[str, set[str]]) -> None:
    """The fit of your model and of the augmented one, on recordings of each kind, what says most first: of
    the signal that your model simulates worst there, everywhere the same one."""
    name = ""
    for part in ("test", "validation", "estimation"):
        yours, _, after = (content["fit"][model][part] for model in ("given", "baseline", "augmented"))
        if yours:
            told = judged(yours, still.get(part, set()))
            name = name if name in told else min(told, key=lambda n: told[n])
            page.key_figure(
                f"{percent(yours[name])} → {percent(after[name])} %", f"fit of {name}", PART_LABELS[part]
            )
