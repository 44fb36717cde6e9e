"""What a line means, and how every page shows it: one colour and one dash per meaning.

The colours began as the palette of Okabe and Ito (jfly.uni-koeln.de/color, 2008) and were moved until any two
lie at least 14 apart in CIE Lab, 20 where both lines are solid, for people with common vision and without
red, green or blue cones (Machado et al., 2009), at a contrast to their ground of at least 3 to 1: the unit
test of colour vision measures it.  The dash says the same once more, for paper without colour.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Role:
    """How a meaning is drawn: ``light`` and ``dark``: its colours (#rrggbb) on a white and on a dark page;
    ``dash``: lengths (pixels) of stroke and gap, none for a solid line; ``width`` of the line, pixels."""

    light: str
    dark: str
    dash: tuple[int, ...] = ()
    width: float = 1.4


ROLES: dict[str, Role] = {
    "measured": Role("#1c2432", "#f0f3f7", width=1.2),
    "given": Role("#c95500", "#f5954a", (2, 3), 1.9),
    "re-estimated": Role("#0b9b79", "#4de7b6", (8, 4), 1.8),
    "augmented": Role("#0072b2", "#56b4e9", width=2.8),
    "reference": Role("#bd649a", "#fab8e5", (9, 3, 2, 3), 1.4),
    "input": Role("#5b636f", "#adaeb3", width=1.1),
    "second": Role("#aa8a40", "#f0db68", (12, 3), 1.5),
    "third": Role("#005675", "#0792af", (4, 2), 1.5),
    "fourth": Role("#592c8b", "#9f83f0", (6, 2, 2, 2, 2, 2), 1.5),
    "alarm": Role("#bd0640", "#ef6d8b", (6, 4), 1.6),
}
"""measured: what a recording holds; given: the user's model, or a simulation with it; re-estimated: its
structure fitted anew; augmented: with the physics that was found; reference: what a law or a command asks
for; input: what drives; second to fourth: further quantities or runs of the same meaning, in their order;
alarm: what is out of its limits."""

RUNS = ("measured", "second", "third", "fourth", "input", "reference")
"""Roles of several recordings laid over each other, in their order; from the seventh on they repeat."""
MODELS = ("given", "re-estimated", "augmented", "third", "fourth", "second", "alarm", "input")
"""Roles of several models simulated on one recording, in their order; from the ninth on they repeat. Not
the reference: the residual view leaves it out."""
#: Where the roles begin that say nothing of a model.
_FURTHER = 3


def variable(role: str) -> str:
    """The CSS variable that holds a role's colour."""
    return f"--{role}"


def variables(dark: bool) -> str:
    """CSS declarations of all roles' colours, for a light or a dark page."""
    return " ".join(f"{variable(n)}: {r.dark if dark else r.light};" for n, r in ROLES.items())


def model_roles(effects: Sequence[int], told: Sequence[str | None] = ()) -> list[str]:
    """Roles of several models, whatever their order, by what their files say of themselves (``told``, None
    for nothing) and how many ``effects`` each has: of those that say nothing the first with the fewest is the
    given one, and those with more are augmented ones. A role that is taken leaves a further one."""
    told = list(told) or [None] * len(effects)
    fewest = min((n for n, role in zip(effects, told, strict=True) if role != "augmented"), default=0)
    roles: list[str] = []
    for count, role in zip(effects, told, strict=True):
        wanted = role or ("augmented" if count > fewest else "given")
        free = [r for r in (wanted, *MODELS[_FURTHER:], *MODELS) if r not in roles]
        # Never as what was measured, over which they are drawn.
        roles.append(free[0] if free else MODELS[len(roles) % len(MODELS)])
    return roles
