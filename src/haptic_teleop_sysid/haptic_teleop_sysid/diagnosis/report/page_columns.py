"""The part of the page that holds three models against each other: yours, re-estimated, augmented."""

from __future__ import annotations

from typing import Any

from haptic_teleop_sysid.recordings.small_motion import hardly_moving, spread
from haptic_teleop_sysid.report import Page, unit_text, with_error

from ..evidence.proof import MODELS, PARTS, Proof
from .summary import LIMIT, PART_LABELS, percent

HEADS = ("yours", "re-estimated", "augmented")
"""What the models of `MODELS` are called."""


_MADE_UP = (
    " Re-estimated, your structure makes up for what is missing by wrong numbers, further off than their ±."
)


def fits(page: Page, content: dict[str, Any], proof: Proof) -> None:
    """Fits of the three models on all kinds of recordings, with how far each signal moves."""
    rows, told = [], content["uses"]["what"]
    for part in PARTS:
        columns = [content["fit"][model][part] for model in MODELS]
        moves = _moves(proof, part)
        rows += [
            (name, *(percent(c[name]) for c in columns), moves.get(name, "–"), PART_LABELS[part])
            for name in columns[0]
        ]
    section = page.section("Yours, re-estimated, augmented")
    section.table(
        ("signal", *(f"{head} (%)" for head in HEADS), "moves by", "recordings"),
        rows,
        "Simulated response to the recorded command, in percent of the signal's deviation: of your model as "
        "it came, of its structure re-estimated on the estimation recordings, and with what was found.",
    )
    section.text(f"{told[0].upper()}{told[1:]}. {content['fit']['windows']}.")


def _moves(proof: Proof, part: str) -> dict[str, str]:
    """How far each signal moves on the recordings of a part, the one that moves least, and whether that is
    hardly."""
    found: dict[str, tuple[float, str]] = {}
    still = hardly_moving(proof.parts[part])
    for dataset in proof.parts[part]:
        for name, values in dataset.signals().items():
            one = (spread(values), dataset.units()[name])
            found[name] = min(found.get(name, one), one)
    return {
        name: f"{size:.3g} {unit}{' (hardly moves)' if name in still else ''}"
        for name, (size, unit) in found.items()
    }


def parameters(page: Page, content: dict[str, Any]) -> None:
    """The numbers of the three models."""
    models = [content["models"][model]["parameters"] for model in MODELS]
    rows = [
        (
            name,
            unit_text(models[2][name]["unit"]),
            f"{models[0][name]['value']:.5g}" if name in models[0] else "–",
            *(cell for column in (models[2], models[1]) for cell in _cells(column.get(name))),
        )
        for name in models[2]
    ]
    page.section(
        "Parameters", f"augmented_model.yaml holds {content['augmented_model']['what']}: simulate with it."
    ).table(
        ("parameter", "unit", "yours", "augmented", "change", "re-estimated", "change"),
        rows,
        "± is the standard error, with what the other recordings differ by; a parameter without one was "
        "held, is at a bound, or cannot be determined from these recordings."
        + (_MADE_UP if content["verdict"] != "no_mismatch" else ""),
    )


def _cells(number: dict[str, Any] | None) -> tuple[str, str]:
    """Value with its standard error, and change of a parameter."""
    if number is None:
        return "–", "–"
    bound = "" if number["at_bound"] is None else f" ({LIMIT[number['at_bound']]})"
    change = number["change"]
    return (
        f"{with_error(number['value'], number['std'], relative_to=number.get('relative_to'))}{bound}",
        "–" if change is None else f"{100 * change:+.1f} %",
    )
