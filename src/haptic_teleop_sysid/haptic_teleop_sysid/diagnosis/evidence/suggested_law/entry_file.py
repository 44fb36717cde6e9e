"""A suggested law as the file of a ready effect entry, to be read, changed and added by hand."""

from __future__ import annotations

import re
import textwrap
from typing import Any

from haptic_teleop_sim.effects.torque_map import TorqueMap

from .regression import Law

#: What the file is called beside the other results.
FILE = "suggested_effect.py"
#: Factor over the steepest slope that was measured for which the kernel's steps are chosen.
_STEEPER = 2.0
_FILE = """'''An effect suggested by a diagnosis: {words}.

It was drawn from recordings and nobody has thought about it yet: give it a name, a sentence and bounds that
mean something, or throw it away. To add it, put this file beside `effects/registry.py` in the package
haptic_teleop_sim, list its module there, and diagnose the same recordings again.
'''

from .entry import EffectEntry
from .parameter import {contact}EffectParameter

SUGGESTED = EffectEntry(
    name="{name}",
    kind="torque",
    where=("{place}",),
    parameters=(
{parameters}    ),
    sentence="a torque that follows a law which was suggested by recordings",
    equation=lambda s, p: (
{equation}
    ),
    rate=lambda p, ks: ({stiffness!r}, {damping!r}),
    condition="the suggested law",
{more})
ENTRIES = (SUGGESTED,)
"""


def law_content(law: Law, table: TorqueMap, explained: float | None) -> dict[str, Any]:
    """For the result file; ``explained``: what the map explains. ``entry`` is the text of the file."""
    share = law.explained / explained if explained else 1.0
    part = f"{100 * min(share, 1.0):.0f} %"
    return {
        "what": f"it may be {law_words(law)} (N*m, rad, rad/s), which explains {part} of what the map does; "
        f"{FILE} beside this result has it as an effect to read, add and diagnose with again",
        "formula": law_words(law),
        "share_of_map": round(float(share), 3),
        "file": FILE,
        "entry": entry_file(law, table),
    }


def entry_name(law: Law) -> str:
    """Name of the effect."""
    return f"suggested_{law.terms[0].place}_torque"


def entry_file(law: Law, table: TorqueMap) -> str:
    """Content of the file; ``table``: the map that the law stands for. No text of the user's is in it."""
    parameters, terms = [], []
    for number, (term, size) in enumerate(zip(law.terms, law.coefficients, strict=True), start=1):
        own = f"size{number}"
        unit = "N*m" + "".join(f"/({f.unit})" for f in term.factors if f.unit != "1")
        parameters.append(_parameter(own, unit, "size of the term", size, sized=True))
        text = f"p.{own} * {term.text}"
        for factor in term.factors:
            for name, value, of in factor.shape:
                parameters.append(_parameter(f"{name}{number}", of, f"{name} of the term", value))
                text = re.sub(rf"\bp\.{name}\b", f"p.{name}{number}", text)
        terms.append(text)
    more = contact = ""
    if any("s.direction" in text for text in terms):
        parameters.append("        *CONTACT,\n")
        more, contact = '    memory="direction",\n', "CONTACT, "
    return _FILE.format(
        contact=contact,
        words=law_words(law),
        name=entry_name(law),
        place=law.terms[0].place,
        parameters="".join(parameters),
        equation=textwrap.indent("\n+ ".join(terms), 8 * " "),
        stiffness=_STEEPER * table.steepest(("angle", "deflection")),
        damping=_STEEPER * table.steepest(("velocity", "deflection_rate")),
        more=more,
    )


def _parameter(name: str, unit: str, meaning: str, value: float, sized: bool = False) -> str:
    end = "" if sized else f", grid=({value!r},), neutral=None"
    return f'        EffectParameter("{name}", "{unit}", "{meaning}", typical={value!r}{end}),\n'


#: What a model file calls the variables of an equation.
_AT_A_LINK = {"position": "angle", "direction": "sign(velocity)"}
_AT_THE_JOINT = {
    "position": "deflection",
    "velocity": "deflection_rate",
    "direction": "sign(deflection_rate)",
}


def law_words(law: Law) -> str:
    """The law as a formula with its numbers, in N*m, rad, rad/s."""
    found = []
    for term, size in zip(law.terms, law.coefficients, strict=True):
        words = _AT_THE_JOINT if term.place == "joint" else _AT_A_LINK
        text = re.sub(r"\bs\.(\w+)", lambda name, words=words: words.get(name[1], name[1]), term.text)
        for factor in term.factors:
            for name, value, _ in factor.shape:
                text = re.sub(rf"\bp\.{name}\b", f"{value:.4g}", text)
        found.append(f"{size:+.4g} * {text}" if text != "1" else f"{size:+.4g}")
    return "torque = " + " ".join(found)
