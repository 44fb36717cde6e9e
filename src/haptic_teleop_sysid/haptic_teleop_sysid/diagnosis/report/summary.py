"""A diagnosis in a few lines for the terminal, and the sentences that it shares with the page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from haptic_teleop_sim.effects import MEASURED
from haptic_teleop_sysid.report.numbers import with_error

from ..decision.adequacy import NEARLY_ALL
from ..decision.unknown.at_the_actuator import WITH_THE_INPUT
from ..decision.words import acts, chance_sentence
from ..evidence.proof import LOWEST
from ..policy import WORSE

PART_LABELS = {
    "estimation": "recordings fitted to",
    "validation": "other recordings, also used to choose",
    "test": "test recordings, neither fitted to nor used to choose",
}
"""What the parts of `fit` are called."""
LIMIT = {"lowest": "the lowest value allowed", "highest": "the highest value allowed"}
"""What is said of a parameter at a bound."""


def settled_sentence(names: Sequence[str]) -> str:
    """What is said where the estimation recordings leave parameters of the structure open; no full stop."""
    words = " and ".join(name.replace("_", " ") for name in names)
    return (
        f"The estimation recordings alone leave the {words} open: with what was found, all parameters are "
        "fitted to the validation recordings, too"
    )


def summary(content: dict[str, Any]) -> str:
    """The verdict in a few lines; said first is that what is handed on is worse than the user's own model."""
    lines = []
    if (apart := content.get("recordings_apart")) is not None:  # none in results of earlier versions
        lines.append(f"{apart['what']}: {apart['remedy']}.")
    worse = content["worse_than_given"]
    if worse is not None and not found_is_better(content):
        lines.append(f"{worse['sentence']}.")
    lines.append(f"verdict: {content['verdict']}")
    if "doubt" in content:
        lines.append(f"  because {content['doubt']}")
    if content["verdict"] == "unknown" and content["where"]:
        places = ", ".join(
            f"{nameless_at(w, content)}, where it {acts(w['condition'])}" for w in content["where"]
        )
        beside = "; beside it:" if content["findings"] else ""
        if (content["adequacy"] or {}).get("only_worse"):
            beside = "; it resembles, and your own model simulates better:"
        lines.append(f"  something without a name at {places}{beside}")
    for f in content["findings"]:
        numbers = ", ".join(finding_number(n, p) for n, p in f["parameters"].items())
        lines.append(f"  {f['effect']} at {f['location']} ({100 * f['confidence']:.0f} %): {numbers}")
        lines += [
            f"    or {a['effect']} at {a['location']} ({100 * a['confidence']:.0f} %)"
            for a in f["alternatives"]
        ]
    if worse is not None and found_is_better(content):
        lines.append(f"  {worse['sentence']}.")
    if settled := content.get("settled_by_both"):  # none in results of earlier versions
        lines.append(f"  {settled_sentence(settled)}.")
    sentence = explains_sentence(content)
    if sentence:
        lines.append(f"  {sentence}")
    if "beside" in content:
        lines.append(f"  beside it {content['beside']}")
    lines += map_sentences(content)
    sentence = moved_sentence(content)
    if sentence:
        lines.append(f"  {sentence}")
    lines += [f"  {text}" for text in _at_bounds(content)]
    if "nulls" in content:
        lines.append(f"  {chance_sentence(content['nulls'])}")
    fit = content["fit"]
    if any(fit["given"].values()):
        lines.append("  fit: yours -> re-estimated -> augmented")
    for part, label in PART_LABELS.items():
        columns = [fit[model][part] for model in ("given", "baseline", "augmented")]
        if columns[0]:
            lines.append(f"  {part} ({label}):")
            lines += [f"    {n} {' -> '.join(percent(c[n]) for c in columns)} %" for n in columns[0]]
    return "\n".join(lines)


def nameless_at(where: dict[str, Any], content: dict[str, Any]) -> str:
    """One place of something without a name, why there, and what else it may be in a rigid joint."""
    place, rigid = where["equation"], content.get("structure") == "rigid_body"
    proportion = content.get("in_proportion")  # none in results of earlier versions
    if proportion and place.endswith("_actuator") and where["condition"] == WITH_THE_INPUT:
        inertia = ", or an inertia that changes" if rigid else ""
        return f"{place} (a share of the input that changes with time{inertia})"
    if not rigid or place.endswith("_encoder"):
        return place
    return f"{place} (motor, actuator or encoder: a rigid joint has one equation for all three)"


def found_is_better(content: dict[str, Any]) -> bool:
    """Whether something is named, and a model with what was found is handed on that simulates nothing worse
    than the user's own. A name beside something unknown may be in no model."""
    worse, held = content["worse_than_given"], content["augmented_model"]["holds"]
    better = worse is None or "augmented" not in worse["models"]
    return bool(content["findings"]) and held == "augmented" and better


def map_sentences(content: dict[str, Any]) -> list[str]:
    """What became of a measured torque where no name was found, and what stands in for it."""
    found = content.get(MEASURED.name)  # none in results of earlier versions
    if found is None:
        return []
    reading = content.get("reading_error") or {}
    told = [found, found.get("law"), reading.get("fit"), content.get("stand_in")]
    return [f"  {one['what']}" for one in told if one is not None]


def explains_sentence(content: dict[str, Any]) -> str:
    """How much of what is missing the findings explain; empty where that is nearly all or none is named."""
    found = content["adequacy"]
    if found is None or not content["findings"]:
        return ""
    parity = found.get("parity", 1.0)  # none in results of earlier versions
    if min(found["torque"], found["free_run"], parity) >= NEARLY_ALL:
        return ""
    if found.get("left_is_random") and parity >= NEARLY_ALL:
        return (
            f"What is named is {100 * found['torque']:.0f} % of the torque that the structure lacks; the "
            "rest is random, as far as these recordings show."
        )
    text = (
        f"What is named explains {100 * found['torque']:.0f} % of the torque that the structure lacks and "
        f"{100 * found['free_run']:.0f} % of the error of its free runs"
    )
    if parity < NEARLY_ALL:
        text += f", and {100 * parity:.0f} % of what the parity equations of other places leave"
    left = content["left_over"]
    if left is not None:
        text += f"; {100 * left['explained']:.0f} % of the torque that is left at {left['equation']} follows "
        text += f"the {left['follows']}"
    return f"{text}."


def moved_sentence(content: dict[str, Any]) -> str:
    """What is said of the parameters that are not as given; empty where there is nothing to say."""
    found = content["parameters_moved"]
    if not found:
        if content["verdict"] != "no_mismatch" or content["augmented_model"]["holds"] != "baseline":
            return ""
        given, again = (_mean(content["fit"][model]["validation"]) for model in ("given", "baseline"))
        if again - given > WORSE:
            return (
                f"Re-estimated, your structure simulates better ({given:.1f} -> {again:.1f} %), but none of "
                "its parameters alone is off beyond its uncertainty and 5 %: hold one that is known, such as "
                "the torque constant or an inertia (`fixed`), and the others show."
            )
        return "None of your parameters is off beyond its uncertainty and 5 %."
    numbers = ", ".join(moved_words(m) for m in found)
    if content["verdict"] == "no_mismatch":
        return f"Your parameters are off, no physics is missing: {numbers}."
    return f"Beside what is missing, your parameters are off: {numbers}."


def _mean(fits: Mapping[str, float]) -> float:
    """Of the fits of all signals, %, as `Proof.mean` has it: one that runs away counts as LOWEST, one of a
    signal that does not change not at all."""
    known = [max(f, LOWEST) for f in fits.values() if f == f]
    return sum(known) / len(known) if known else 0.0


def moved_words(moved: dict[str, Any]) -> str:
    """A parameter that moved: name, both values, standard error, unit."""
    name = moved["parameter"].replace("_", " ")
    number = with_error(moved["value"], moved["std"], moved["unit"], moved.get("relative_to"))
    return f"{name} {moved['given']:.4g} -> {number}"


def percent(fit: float | None) -> str:
    """A fit as it is printed, without its unit; one of a simulation that ran away is said so."""
    if fit is None or fit != fit:
        return "none"
    return f"{fit:.1f}" if fit > -1000.0 else "< -1000"


def finding_number(name: str, p: dict[str, Any]) -> str:
    """A finding's parameter by name, with its error and unit, and whether it is at a bound."""
    bound = f" ({LIMIT[p['at_bound']]})" if "at_bound" in p else ""
    return f"{name} {with_error(p['value'], p['std'], p['unit'])}{bound}"


def _at_bounds(content: dict[str, Any]) -> Iterator[str]:
    """Parameters at a bound that no finding has told."""
    told = {f"{f['location']}.{f['effect']}.{n}" for f in content["findings"] for n in f["parameters"]}
    for name, p in content["models"]["augmented"]["parameters"].items():
        if p["at_bound"] is not None and name not in told:
            number = with_error(p["value"], None, p["unit"])
            unit = ": see whether the input has its unit" if name == "torque_constant" else ""
            yield f"{name.replace('_', ' ')} {number} is {LIMIT[p['at_bound']]}{unit}"
