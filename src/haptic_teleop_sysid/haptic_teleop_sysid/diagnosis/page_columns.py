"""The part of the page that holds three models against each other: yours, re-estimated, augmented."""

from __future__ import annotations

from typing import Any

from haptic_teleop_sysid.report import Page

from .proof import MODELS, PARTS
from .summary import LIMIT, PART_LABELS, explains_sentence, moved_sentence, percent

HEADS = ("yours", "re-estimated", "augmented")
"""What the models of `MODELS` are called."""


def first_sentences(page: Page, content: dict[str, Any]) -> None:
    """What is said before the verdict: that something is worse than the user's own model."""
    worse = content["worse_than_given"]
    if worse is not None:
        found = bool(content["findings"]) and "augmented" not in worse["models"]
        page.verdict("fair" if found else "bad", f"{worse['sentence']}.")


def explains(page: Page, content: dict[str, Any]) -> None:
    """How much of what is missing was explained, where that is not nearly all."""
    sentence = explains_sentence(content)
    if sentence:
        page.verdict("fair", sentence)


def moved(page: Page, content: dict[str, Any]) -> None:
    """The user's parameters that are off, as a verdict."""
    sentence = moved_sentence(content)
    if sentence:
        page.verdict("fair" if content["parameters_moved"] else "good", sentence)


def key_figures(page: Page, content: dict[str, Any]) -> None:
    """The fit that gained most by what was found, on recordings of each kind, what says most first."""
    for part in reversed(PARTS):
        yours, _, after = (content["fit"][model][part] for model in MODELS)
        if yours:
            name = min(yours, key=yours.get)
            page.key_figure(
                f"{percent(yours[name])} → {percent(after[name])} %", f"fit of {name}", PART_LABELS[part]
            )


def fits(page: Page, content: dict[str, Any]) -> None:
    """Fits of the three models on all kinds of recordings."""
    rows, told = [], content["uses"]["what"]
    for part in PARTS:
        columns = [content["fit"][model][part] for model in MODELS]
        rows += [(part, name, *(percent(c[name]) for c in columns)) for name in columns[0]]
    page.section(
        "Yours, re-estimated, augmented",
        "Simulated response to the recorded command, in percent of the signal's deviation: of your model as "
        "it came, of its structure re-estimated on the estimation recordings, and with what was found. "
        + content["fit"]["windows"],
    ).text(f"{told[0].upper()}{told[1:]}.").table(("recordings", "signal", *HEADS), rows)


def parameters(page: Page, content: dict[str, Any]) -> None:
    """The numbers of the three models."""
    models = [content["models"][model]["parameters"] for model in MODELS]
    rows = [
        (
            name,
            models[2][name]["unit"],
            f"{models[0][name]['value']:.5g}" if name in models[0] else "–",
            *(cell for column in models[1:] for cell in _cells(column.get(name))),
        )
        for name in models[2]
    ]
    page.section(
        "Parameters", f"augmented_model.yaml holds {content['augmented_model']['what']}: simulate with it."
    ).table(
        ("parameter", "unit", "yours", "re-estimated", "±", "change", "augmented", "±", "change"),
        rows,
        "± is the standard error, with what the other recordings differ by; a parameter without one was "
        "held, is at a bound, or cannot be determined from these recordings.",
    )


def _cells(number: dict[str, Any] | None) -> tuple[str, str, str]:
    """Value, standard error and change of a parameter."""
    if number is None:
        return "–", "–", "–"
    bound = "" if number["at_bound"] is None else f" ({LIMIT[number['at_bound']]})"
    std, change = number["std"], number["change"]
    return (
        f"{number['value']:.5g}{bound}",
        "–" if std is None else f"{std:.2g}",
        "–" if change is None else f"{100 * change:+.1f} %",
    )
