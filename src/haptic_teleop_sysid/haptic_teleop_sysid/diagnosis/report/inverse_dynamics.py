"""What the inverse dynamics said, for the result file and the page, and whether the verdict agrees."""

from __future__ import annotations

from typing import Any

from haptic_teleop_sysid.report import Page

from ..decision.verdict import Verdict
from ..evidence.second_method import JudgedGroup, SecondMethod

_MOST_TOLD = 5


def inverse_dynamics_content(second_method: SecondMethod, verdict: Verdict, believed: bool) -> dict[str, Any]:
    """The content of ``inverse_dynamics`` in diagnosis.json; ``believed``: whether it made the verdict."""
    searched, chosen = second_method.searched, second_method.chosen
    found: dict[str, Any] = {
        "cutoff_hz": round(searched.cutoff, 3),
        "verdict_from_here": believed,
        "agrees": _agrees(chosen, verdict),
        "structure": {"torque_fit": round(searched.structure.percent, 1)},
        "recoverable": round(searched.recoverable, 3),
        "recoverable_by": [
            {"equation": s.location, "quantities": list(s.quantities)} for s in searched.free_curves
        ],
        "groups": [
            _group(judged) | {"weight": round(weight, 3)}
            for judged, weight in second_method.rivals[:_MOST_TOLD]
        ],
    }
    if chosen is not None:
        found["adequacy"] = round(second_method.adequacy, 3)
        beside = searched.beside(chosen.group)
        if beside is not None:
            latent, share = beside
            found["left_over"] = {
                "equation": latent.location,
                "quantities": list(latent.quantities),
                "share_of_what_is_left": round(share, 3),
            }
    return found


def _group(judged: JudgedGroup) -> dict[str, Any]:
    group = judged.group
    return {
        "effects": [
            {"effect": e.effect, "location": e.location, "parameters": dict(e.parameters)}
            for e in group.effects
        ],
        "parameters": {n: group.model.parameters[n] for n in group.std if "." not in n},
        "torque_fit": round(group.percent, 1),
        "explained": round(group.explained, 3),
        "free_run_error": {
            "estimation": round(judged.errors[0], 4),
            "validation": round(judged.errors[1], 4),
        },
    }


def _agrees(chosen: JudgedGroup | None, verdict: Verdict) -> bool | None:
    """Whether both name the same effects at the same places; None where the inverse dynamics name none."""
    if chosen is None:
        return None
    own = {(e.effect, e.location) for e in chosen.group.effects}
    return own == {(f["effect"], f["location"]) for f in verdict.findings}


def second_method_sentence(content: dict[str, Any]) -> str:
    """What the inverse dynamics say of the findings, for and against, in a sentence."""
    found, head = content["inverse_dynamics"], "The second method, inverse dynamics,"
    if found is None:
        return f"{head} says nothing: its arithmetic failed on these recordings."
    if found["agrees"] is None:
        return f"{head} names nothing: no torque along the motion gains enough there."
    if found["verdict_from_here"]:
        return f"{head} made this answer."
    if found["agrees"]:
        return f"{head} names the same."
    told = {(f["effect"], f["location"]) for f in content["findings"]}
    own = [(e["effect"], e["location"]) for e in found["groups"][0]["effects"]]
    more = " and ".join(f"{effect} at {place}" for effect, place in own if (effect, place) not in told)
    if told and told <= set(own):
        return f"{head} names the same, and beside it {more}, which the first does not bear out."
    if not told:
        return f"{head} names {more}, which the first does not bear out."
    return f"{head} names {more or 'less'} instead: take the answer with care."


def at_reversals(found: dict[str, Any]) -> str:
    """What the torque does where the motion turns, in a sentence."""
    size, here, there = found["torque"], found["estimation"], found["validation"]
    return (
        f"Where the motion turns, the torque at {found['location']} jumps by twice "
        f"{size['value']:.3g} ± {size['std']:.2g} {size['unit'].replace('*', '·')} "
        f"({here['value']:.3g} and {there['value']:.3g} on the two kinds of recordings, "
        f"{here['reversals']} and {there['reversals']} reversals): that is {found['effect']} of this size, "
        "whatever else acts there."
    )


def inverse_dynamics_section(page: Page, content: dict[str, Any]) -> None:
    """The page's section on the inverse dynamics."""
    found = content["inverse_dynamics"]
    title = "What the inverse dynamics say"
    if found is None:
        page.section(title, "Nothing: their arithmetic failed on these recordings.")
        return
    section = page.section(title, f"{_sentence(found)} {second_method_sentence(content)}", folded=True)
    if found["groups"]:
        section.table(
            ("effects", "torque fit of validation", "explained of what is missing", "simulated error"),
            [
                (
                    " and ".join(f"{e['effect']} at {e['location']}" for e in g["effects"]),
                    f"{g['torque_fit']:z.0f} %",
                    f"{100 * g['explained']:z.0f} %",
                    f"{100 * g['free_run_error']['validation']:.1f} % of the motion",
                )
                for g in found["groups"]
            ],
            "Effects that were fitted together to the input below that frequency, and then simulated",
        )


def _sentence(found: dict[str, Any]) -> str:
    text = (
        f"The equations of motion, filtered at {found['cutoff_hz']:.3g} Hz and solved by least squares, "
        "without any model of the noise."
    )
    if found["agrees"] is not None and found["verdict_from_here"]:
        text += (
            " They made the verdict: simulated freely, what they name comes nearer to the recordings than "
            "what one-step prediction found."
        )
    left = found.get("left_over")
    if left is not None:
        text += (
            f" Of what is left, {100 * left['share_of_what_is_left']:.0f} % follows "
            f"{' and '.join(left['quantities'])} at {left['equation']}."
        )
    return text
