"""How sure a diagnosis is, and why: what speaks for each finding, what else it could be, where and when it
shows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from haptic_teleop_sysid.report import Page, Section

from ..decision.adequacy import nothing_shown
from ..decision.search.rounds import SearchResult
from ..decision.verdict import Verdict
from ..decision.words import chance_sentence
from ..policy import HOLDS_BETTER, SUREST
from .contents import not_believed
from .inverse_dynamics import at_reversals, second_method_sentence
from .law_torque import TIME
from .page_law import LawCurve, explained_after
from .page_lead import parameter_text

#: What the share of a place is one of: with names, and without.
_GAINED, _LEFT = "share of the gain in log-likelihood", "share of the left-over torque"


def reasons(page: Page, verdict: Verdict, content: dict[str, Any], curves: list[LawCurve]) -> None:
    """The section with all of that."""
    section = page.section("How sure, and why")
    for f in verdict.findings:
        section.text(f["because"])
        section.table(
            ("parameter", "value"),
            [(name, parameter_text(p)) for name, p in f["parameters"].items()],
            f"{f['effect']} at {f['location']}: confidence {100 * f['confidence']:.0f} %",
        )
        if f["alternatives"]:
            section.table(
                ("other explanation", "at", "confidence"),
                [(a["effect"], a["location"], f"{100 * a['confidence']:.0f} %") for a in f["alternatives"]],
                f"What {f['effect']} at {f['location']} could be instead",
            )
    surest = SUREST if verdict.adequacy is None else verdict.adequacy.surest
    if any(f["confidence"] == round(surest, 4) for f in verdict.findings):
        section.text(_ceiling(verdict, surest))
    if verdict.findings:
        section.text(second_method_sentence(content))
    for one in content.get("reversals", ()):
        section.text(at_reversals(one))
    for c in curves:
        section.text(
            f"The dots against {_named(c)} are means, in which what is random cancels: with {c.name} "
            f"{100 * c.explained:.0f} % of their mean square is gone."
        )
    _where(section, verdict, content, curves)
    if "nulls" in content:
        section.text(f"By chance alone: {chance_sentence(content['nulls'])}.")


def _named(curve: LawCurve) -> str:
    """The quantity that a curve follows, with its article."""
    return curve.quantity if curve.quantity == TIME else f"the {curve.quantity}"


def _where(section: Section, verdict: Verdict, content: dict[str, Any], curves: Sequence[LawCurve]) -> None:
    """Where it sits, when it shows, and at which times of the first recording."""
    rows = [
        (w["equation"], f"{100 * w['share']:.0f} %", w["condition"], _when(w, curves))
        for w in content["where"]
    ]
    if rows:
        caption = "Where and when it shows; times are those of the first recording that was fitted to"
        named = content["verdict"] != "unknown" or nothing_shown(verdict.adequacy)
        share = _GAINED if named else _LEFT
        section.table(("place", share, "depends on", "strongest at"), rows, caption)
    parity = content.get("parity")  # none of rigid joints
    if parity and parity["left"]:
        left = sorted(parity["left"].items(), key=lambda one: one[1])
        beside = f"; allowed for: {', '.join(parity['beside'])}" if parity["beside"] else ""
        section.table(
            ("place", "its equation leaves, of the input's torque"),
            [(place, f"{100 * share:.2g} %") for place, share in left],
            "The equation of motion without what acts at a place holds if that is the right place; one that "
            f"leaves less by a factor of {HOLDS_BETTER:g} decides{beside}",
        )
    proportion = content.get("in_proportion")  # where it was asked
    if proportion:
        section.table(
            ("in proportion to", "log-likelihood gained"),
            [(name, f"{gain:z.0f}") for name, gain in proportion.items()],
            "What is missing at the motor, as a multiple of one quantity that changes with time at random: "
            "of the input, if the actuator makes it, or of the motion",
        )


def _when(where: dict[str, Any], curves: Sequence[LawCurve]) -> str:
    """The times at which it is strongest: of what changes in the course of a recording, when its torque has
    half of its greatest size."""
    changes = [c.there for c in curves if c.place == where["equation"] and c.there is not None]
    if changes and TIME in where["condition"].split():
        return ", ".join(f"{a:.1f}–{b:.1f} s" for a, b in changes)
    return ", ".join(f"{a:g}–{b:g} s" for a, b in where["intervals"]) or "throughout"


def _ceiling(verdict: Verdict, surest: float) -> str:
    """Why no confidence is higher."""
    found = verdict.adequacy
    if found is None or surest == SUREST:
        return (
            f"{100 * SUREST:.0f} % is the most that is said: of names without a rival about one in twenty "
            "was wrong in tests with concealed truth."
        )
    if found.random_left and surest > found.least:
        return (
            f"Confidence is limited to {100 * surest:.0f} %: what is named explains little beside torque "
            "that is random."
        )
    named = " and ".join(dict.fromkeys(f["effect"] for f in verdict.findings)) or "what is named"
    limited = f"Confidence is limited to {100 * surest:.0f} %:"
    if found.nearly_all_torque:
        return (
            f"{limited} {named} explains {100 * found.least:.1f} % (mean square) of what is missing, but "
            "predictions of the next sample ask for more."
        )
    if found.explains_nearly_all and found.worse:
        return f"{limited} with {named} recordings are simulated worse than by your own model."
    if found.explains_nearly_all and found.follows is not None:
        return f"{limited} most of the torque that {named} leaves follows the {found.follows.quantity}."
    if found.explains_nearly_all and not found.recovers_nearly_all:
        return (
            f"{limited} a free curve explains more, as a whole or in the quantities of one of the "
            f"findings, of which these have {100 * found.recovered:.0f} % (mean square)."
        )
    return f"{limited} {named} explains {100 * found.least:.1f} % (mean square) of what is missing."


def curves_table(page: Page, verdict: Verdict) -> None:
    """What the left-over torque follows, before and after."""
    # Where no name is believed there is no after.
    after = verdict.remaining is not verdict.before
    rows = []
    for c in verdict.before[:6]:
        shares = (max(c.explained, 0.0), *([explained_after(c, verdict)] if after else []))
        rows.append((c.equation, c.name, *(f"{100 * share:.0f} %" for share in shares)))
    heads = ("explained before", "explained after") if after else ("explained",)
    if rows:
        page.section("What the left-over torque follows", folded=True).table(
            ("equation", "depends on", *heads),
            rows,
            "share of the left-over torque that a curve explains on recordings it was not drawn from",
        )


def given_up(page: Page, result: SearchResult) -> None:
    """What was found and is not believed, and why."""
    rows = [
        (
            one.found.effect.effect,
            one.found.effect.location,
            f"{one.found.gain:z.0f}",
            f"{one.found.elsewhere:z.0f}",
            one.why,
        )
        for one in not_believed(result)
    ]
    if rows:
        text = "Each predicted the recordings better, and something spoke against it."
        head = ("effect", "at", "log-likelihood gained", "on validation recordings", "why it is not believed")
        page.section("Found and given up", text, folded=True).table(head, rows)


def tried(page: Page, result: SearchResult) -> None:
    """What did not stand up."""
    rows = [
        (
            e.effect.effect,
            e.effect.location,
            f"{e.gain:z.0f}",
            f"{e.elsewhere:z.0f}",
            "yes" if e.material else "no",
        )
        for e in result.last_round[:10]
    ]
    if rows:
        text = "Further effects that did not stand up in the last round of the search."
        head = ("effect", "at", "log-likelihood gained", "on validation recordings", "large enough to matter")
        page.section("What else was tried", text, folded=True).table(head, rows)
